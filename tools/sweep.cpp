#include "tools/sweep.h"

#include <algorithm>

#include "common/errors.h"

namespace holdfast {
namespace {

std::string one_line(const YAML::Node& node) {
  if (node.IsScalar()) return node.Scalar();
  YAML::Emitter emitter;
  emitter.SetMapFormat(YAML::Flow);
  emitter.SetSeqFormat(YAML::Flow);
  emitter << node;
  std::string text = emitter.c_str();
  for (char& c : text) {
    if (c == '\n') c = ' ';
  }
  return text;
}

// What is wrong with the values of a key; "" for nothing.
std::string problem_of(const std::vector<std::string>& values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (values[i].empty() || values[i] == "~") return "has an empty value";
    if (std::find(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(i), values[i]) !=
        values.begin() + static_cast<std::ptrdiff_t>(i))
      return "has the value " + values[i] + " twice";
  }
  return "";
}

std::string trimmed(const std::string& text) {
  const auto first = text.find_first_not_of(" \t");
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

}  // namespace

std::vector<std::vector<std::string>> Sweep::points() const {
  std::vector<std::vector<std::string>> points;
  if (!grid.empty()) {
    points.emplace_back();
    for (const SweepAxis& axis : grid) {
      std::vector<std::vector<std::string>> longer;
      for (const auto& point : points) {
        for (const std::string& value : axis.values) {
          longer.push_back(point);
          longer.back().push_back(axis.key + "=" + value);
        }
      }
      points = std::move(longer);
    }
  }
  points.insert(points.end(), list.begin(), list.end());
  if (points.empty()) points.emplace_back();
  return points;
}

Sweep read_sweep(ConfigurationMap& map, const std::string& key) {
  Sweep sweep;
  if (!map.has(key)) return sweep;
  ConfigurationMap below = map.map(key);
  const YAML::Node grid = below.raw("grid");
  if (grid.IsDefined() && !grid.IsMap()) below.problem("grid", "must be a map: path: [values]");
  for (const auto& entry : grid.IsMap() ? grid : YAML::Node(YAML::NodeType::Map)) {
    SweepAxis axis{entry.first.Scalar(), {}};
    if (!entry.second.IsSequence() || entry.second.size() == 0) {
      below.problem("grid", axis.key + " must have a list of values");
      continue;
    }
    for (const auto& value : entry.second) axis.values.push_back(one_line(value));
    if (const std::string problem = problem_of(axis.values); !problem.empty())
      below.problem("grid", axis.key + " " + problem);
    sweep.grid.push_back(std::move(axis));
  }
  const YAML::Node list = below.raw("list");
  if (list.IsDefined() && !list.IsSequence())
    below.problem("list", "must be a list of maps: [{path: value}]");
  for (const auto& point : list.IsSequence() ? list : YAML::Node(YAML::NodeType::Sequence)) {
    if (!point.IsMap() || point.size() == 0) {
      below.problem("list", "each point must be a map: {path: value}");
      continue;
    }
    std::vector<std::string> assignments;
    for (const auto& entry : point)
      assignments.push_back(entry.first.Scalar() + "=" + one_line(entry.second));
    sweep.list.push_back(std::move(assignments));
  }
  return sweep;
}

SweepAxis parse_sweep_axis(const std::string& text) {
  const auto equals = text.find('=');
  const auto refuse = [&text](const std::string& why) {
    throw UsageError("--sweep " + text + ": " + why + "; write it as path.to.key=value,value,...");
  };
  if (equals == std::string::npos || equals == 0) refuse("there is no key");
  SweepAxis axis{trimmed(text.substr(0, equals)), {}};
  YAML::Node values;
  try {
    values = YAML::Load("[" + text.substr(equals + 1) + "]");
  } catch (const YAML::Exception& error) {
    refuse("the values are not YAML: " + error.msg);
  }
  if (!values.IsSequence() || values.size() == 0) refuse("there is no value");
  for (const auto& value : values) axis.values.push_back(one_line(value));
  if (const std::string problem = problem_of(axis.values); !problem.empty())
    refuse("it " + problem);
  return axis;
}

std::vector<std::string> parse_sweep_point(const std::string& text) {
  std::vector<std::string> assignments;
  std::size_t start = 0;
  while (start <= text.size()) {
    const std::size_t end = std::min(text.find(';', start), text.size());
    const std::string assignment = trimmed(text.substr(start, end - start));
    start = end + 1;
    if (assignment.empty()) continue;
    const auto equals = assignment.find('=');
    if (equals == std::string::npos || equals == 0)
      throw UsageError("--point " + text + ": write it as 'path=value; path=value'");
    assignments.push_back(assignment);
  }
  if (assignments.empty()) throw UsageError("--point " + text + ": names no key");
  return assignments;
}

std::string sweep_label(const std::vector<std::string>& assignments) {
  std::string label;
  for (const std::string& assignment : assignments)
    label += (label.empty() ? "" : ", ") + assignment;
  return label;
}

}  // namespace holdfast
