#include "common/configuration.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "common/configuration_override.h"
#include "common/configuration_text.h"
#include "common/name_list.h"

namespace holdfast {

struct ConfigurationMap::Shared {
  std::string file_name;
  YAML::Node document;
  YAML::Node resolved{YAML::NodeType::Map};
  std::set<std::string> known_paths, raw_paths;
  // Whoever reads a hundred problems mends these first.
  static constexpr std::size_t kProblemsMax = 100;
  std::vector<std::pair<YAML::Mark, std::string>> problems;
  std::size_t num_untold = 0;
  // Entries of all lists of maps, whose defaults take far more memory than they do.
  static constexpr std::size_t kEntriesMax = 4096;
  std::size_t num_entries = 0;
  bool may_read_files = true;
  // Overrides are read as if they stood on the lines after the file's last one.
  std::vector<std::string> overrides;
  int num_file_lines = 0;

  void add_problem(const YAML::Mark& mark, const std::string& text) {
    if (problems.size() < kProblemsMax) {
      problems.emplace_back(mark, text);
    } else {
      ++num_untold;
    }
  }

  std::string place(const YAML::Mark& mark) const {
    if (mark.is_null()) return file_name;
    if (mark.line >= num_file_lines && !overrides.empty()) {
      const auto last = overrides.size() - 1;
      return "--set " +
             overrides[std::min(static_cast<std::size_t>(mark.line - num_file_lines), last)];
    }
    return file_name + ":" + std::to_string(mark.line + 1) + ":" + std::to_string(mark.column + 1);
  }

  // A key that an override made has no place of its own; what stands below it has one.
  static YAML::Mark mark_of(const YAML::Node& key, const YAML::Node& value) {
    if (!key.Mark().is_null()) return key.Mark();
    if (!value.Mark().is_null() || !value.IsMap() || value.size() == 0) return value.Mark();
    return mark_of(value.begin()->first, value.begin()->second);
  }

  // Keys that no reader asked for are spelling mistakes or belong to another version.
  void report_unknown(const YAML::Node& node, const std::string& path) {
    if (node.IsMap()) {
      std::set<std::string> seen;
      for (const auto& entry : node) {
        const std::string key = entry.first.Scalar();
        const std::string below = path.empty() ? key : path + "." + key;
        const YAML::Mark mark = mark_of(entry.first, entry.second);
        if (!seen.insert(key).second) add_problem(mark, below + ": key given twice");
        if (!known_paths.contains(below)) {
          add_problem(mark, below + ": unknown key");
        } else if (!raw_paths.contains(below)) {
          report_unknown(entry.second, below);
        }
      }
    } else if (node.IsSequence()) {
      for (std::size_t i = 0; i < node.size(); ++i) {
        report_unknown(node[i], path + "[" + std::to_string(i) + "]");
      }
    }
  }
};

namespace {

YAML::Node list_of(const std::vector<double>& values) {
  YAML::Node node(YAML::NodeType::Sequence);
  node.SetStyle(YAML::EmitterStyle::Flow);
  for (const double value : values) node.push_back(shortest_text(value));
  return node;
}

// yaml-cpp reads 010 as eight; a reader expects ten.
bool has_leading_zero(const std::string& text) {
  const std::size_t first = text[0] == '-' || text[0] == '+' ? 1 : 0;
  return text.size() > first + 1 && text[first] == '0' && text[first + 1] >= '0' &&
         text[first + 1] <= '9';
}

int count_lines(const std::string& text) {
  return static_cast<int>(std::count(text.begin(), text.end(), '\n')) + 1;
}

std::string shape(const YAML::Node& node) {
  if (node.IsMap()) return "a map";
  if (node.IsSequence()) return "a list";
  if (node.IsNull()) return "empty";
  return "'" + node.Scalar() + "'";
}

}  // namespace

ConfigurationMap::ConfigurationMap(std::shared_ptr<Shared> shared, YAML::Node node,
                                   YAML::Node resolved, std::string path, YAML::Mark mark)
    : shared_(std::move(shared)),
      node_(std::move(node)),
      resolved_(std::move(resolved)),
      path_(std::move(path)),
      mark_(mark) {}

std::string ConfigurationMap::path(std::string_view key) const {
  if (path_.empty() || key.empty()) return path_ + std::string(key);
  return path_ + "." + std::string(key);
}

bool ConfigurationMap::has(std::string_view key) const {
  if (!node_.IsMap()) return false;
  const YAML::Node& node = node_;
  const YAML::Node value = node[std::string(key)];
  return value.IsDefined() && !value.IsNull();
}

void ConfigurationMap::require(std::string_view key) {
  if (!has(key)) shared_->add_problem(mark_, path(key) + ": missing");
}

YAML::Node ConfigurationMap::take(std::string_view key) {
  shared_->known_paths.insert(path(key));
  if (!has(key)) return YAML::Node(YAML::NodeType::Undefined);
  const YAML::Node& node = node_;
  return node[std::string(key)];
}

void ConfigurationMap::problem(std::string_view key, const std::string& text) {
  const YAML::Node& node = node_;
  const YAML::Mark mark = has(key) ? node[std::string(key)].Mark() : mark_;
  shared_->add_problem(mark, path(key) + ": " + text);
}

void ConfigurationMap::choice_problem(std::string_view key, const std::string& given,
                                      const std::vector<std::string>& names) {
  problem(key, "'" + given + "' is none of: " + name_list(names));
}

void ConfigurationMap::resolve(std::string_view key, const YAML::Node& value) {
  resolved_[std::string(key)] = value;
}

void ConfigurationMap::forget(std::string_view key) {
  resolved_.remove(std::string(key));
}

bool ConfigurationMap::number(const YAML::Node& node, std::string_view key, double& value,
                              Interval allowed) {
  double read = 0.0;
  if (!node.IsScalar() || !YAML::convert<double>::decode(node, read) || std::isnan(read)) {
    shared_->add_problem(node.Mark(), path(key) + ": " + shape(node) + " is no number");
    return false;
  }
  // An infinite number only stands where the default is one: an end that is open.
  if (std::isinf(read) && !std::isinf(value)) {
    shared_->add_problem(node.Mark(), path(key) + ": " + node.Scalar() + " must be finite");
    return false;
  }
  if (!allowed.contains(read)) {
    shared_->add_problem(node.Mark(),
                         path(key) + ": " + node.Scalar() + " must be " + allowed.text());
    return false;
  }
  value = read;
  return true;
}

void ConfigurationMap::read(std::string_view key, double& value, Interval allowed) {
  const YAML::Node node = take(key);
  if (node.IsDefined()) number(node, key, value, allowed);
  resolved_[std::string(key)] = shortest_text(value);
}

void ConfigurationMap::read(std::string_view key, std::int64_t& value, Interval allowed) {
  const YAML::Node node = take(key);
  std::int64_t whole = 0;
  if (node.IsDefined()) {
    if (!node.IsScalar() || has_leading_zero(node.Scalar()) ||
        !YAML::convert<std::int64_t>::decode(node, whole)) {
      problem(key, shape(node) + " is no whole number");
    } else if (!allowed.contains(static_cast<double>(whole))) {
      problem(key, node.Scalar() + " must be " + allowed.text());
    } else {
      value = whole;
    }
  }
  resolved_[std::string(key)] = value;
}

void ConfigurationMap::read(std::string_view key, int& value, Interval allowed) {
  std::int64_t wide = value;
  allowed.high = std::min(allowed.high, 2147483647.0);
  allowed.low = std::max(allowed.low, -2147483648.0);
  read(key, wide, allowed);
  value = static_cast<int>(wide);
}

void ConfigurationMap::read(std::string_view key, bool& value) {
  const YAML::Node node = take(key);
  if (node.IsDefined() && (!node.IsScalar() || !YAML::convert<bool>::decode(node, value))) {
    problem(key, shape(node) + " must be true or false");
  }
  resolved_[std::string(key)] = value;
}

void ConfigurationMap::read(std::string_view key, std::string& value) {
  const YAML::Node node = take(key);
  if (node.IsDefined()) {
    if (node.IsScalar()) {
      value = node.Scalar();
    } else {
      problem(key, shape(node) + " must be text");
    }
  }
  resolved_[std::string(key)] = value;
}

void ConfigurationMap::read(std::string_view key, std::vector<std::string>& values) {
  const YAML::Node node = take(key);
  if (node.IsDefined() && node.IsSequence()) {
    values.clear();
    for (const auto& item : node) {
      if (!item.IsScalar())
        shared_->add_problem(item.Mark(), path(key) + ": " + shape(item) + " must be text");
      values.push_back(item.IsScalar() ? item.Scalar() : "");
    }
  } else if (node.IsDefined()) {
    problem(key, shape(node) + " must be a list");
  }
  YAML::Node list(YAML::NodeType::Sequence);
  list.SetStyle(YAML::EmitterStyle::Flow);
  for (const std::string& value : values) list.push_back(value);
  resolved_[std::string(key)] = list;
}

void ConfigurationMap::read(std::string_view key, std::vector<double>& values, std::size_t size,
                            Interval allowed) {
  const YAML::Node node = take(key);
  if (node.IsDefined() && !node.IsSequence()) {
    problem(key, shape(node) + " must be a list of numbers");
  } else if (node.IsDefined() && size != 0 && node.size() != size) {
    problem(key, std::to_string(node.size()) + " numbers, must be " + std::to_string(size));
  } else if (node.IsDefined()) {
    std::vector<double> read(node.size());
    for (std::size_t i = 0; i < read.size(); ++i) number(node[i], key, read[i], allowed);
    values = std::move(read);
  }
  resolved_[std::string(key)] = list_of(values);
}

void ConfigurationMap::read_shared(std::string_view key, std::vector<double>& values,
                                   std::size_t size, Interval allowed) {
  if (!has(key) || !node_[std::string(key)].IsScalar()) {
    read(key, values, size, allowed);
    return;
  }
  double shared = 0.0;
  read(key, shared, allowed);
  values.assign(size, shared);
}

void ConfigurationMap::read(std::string_view key, std::vector<std::vector<double>>& rows,
                            std::size_t columns) {
  const YAML::Node node = take(key);
  if (node.IsDefined() && !node.IsSequence()) {
    problem(key, shape(node) + " must be a list of rows");
  } else if (node.IsDefined()) {
    std::vector<std::vector<double>> read(node.size());
    for (std::size_t i = 0; i < read.size(); ++i) {
      const std::size_t wanted =
          columns != 0 ? columns : (i == 0 ? node[i].size() : read[0].size());
      if (!node[i].IsSequence() || node[i].size() != wanted) {
        shared_->add_problem(node[i].Mark(), path(key) + "[" + std::to_string(i) +
                                                 "]: must be a row of " + std::to_string(wanted) +
                                                 " numbers");
        continue;
      }
      read[i].resize(wanted);
      for (std::size_t j = 0; j < wanted; ++j) number(node[i][j], key, read[i][j], kAnyNumber);
    }
    rows = std::move(read);
  }
  YAML::Node list(YAML::NodeType::Sequence);
  for (const auto& row : rows) list.push_back(list_of(row));
  resolved_[std::string(key)] = list;
}

ConfigurationMap ConfigurationMap::map(std::string_view key) {
  const YAML::Node node = take(key);
  // A map may be read in two places: both write into the same resolved one.
  YAML::Node resolved = resolved_[std::string(key)];
  if (!resolved.IsMap()) resolved = YAML::Node(YAML::NodeType::Map);
  if (node.IsDefined() && !node.IsMap()) problem(key, shape(node) + " must be a map");
  if (node.IsDefined() && node.IsMap()) return {shared_, node, resolved, path(key), node.Mark()};
  return {shared_, YAML::Node(YAML::NodeType::Map), resolved, path(key), mark_};
}

YAML::Node ConfigurationMap::raw(std::string_view key) {
  const YAML::Node node = take(key);
  if (!node.IsDefined()) return node;
  shared_->raw_paths.insert(path(key));
  resolved_[std::string(key)] = node;
  return node;
}

std::vector<ConfigurationMap> ConfigurationMap::maps(std::string_view key, std::size_t most) {
  const YAML::Node node = take(key);
  YAML::Node resolved(YAML::NodeType::Sequence);
  resolved_[std::string(key)] = resolved;
  std::vector<ConfigurationMap> list;
  if (!node.IsDefined()) return list;
  if (!node.IsSequence()) {
    problem(key, shape(node) + " must be a list");
    return list;
  }
  if (node.size() > most) {
    problem(key, "has " + std::to_string(node.size()) + " entries, at most " +
                     std::to_string(most) + " are possible");
    shared_->raw_paths.insert(path(key));
  }
  for (std::size_t i = 0; i < std::min(node.size(), most); ++i) {
    if (++shared_->num_entries > Shared::kEntriesMax) {
      problem(key, "more than " + std::to_string(Shared::kEntriesMax) +
                       " entries in all lists together are too many");
      shared_->raw_paths.insert(path(key));
      return {};
    }
    const std::string item_path = path(key) + "[" + std::to_string(i) + "]";
    YAML::Node item(YAML::NodeType::Map);
    resolved.push_back(item);
    if (!node[i].IsMap()) {
      shared_->add_problem(node[i].Mark(), item_path + ": " + shape(node[i]) + " must be a map");
      continue;
    }
    list.push_back({shared_, node[i], item, item_path, node[i].Mark()});
  }
  return list;
}

bool ConfigurationMap::may_read_file(std::string_view key) {
  if (!shared_->may_read_files) problem(key, "a scenario out of a log or results names no files");
  return shared_->may_read_files;
}

bool ConfigurationMap::scalar_text(std::string_view key, std::string& text) const {
  if (!has(key)) return false;
  const YAML::Node& node = node_;
  const YAML::Node value = node[std::string(key)];
  if (!value.IsScalar()) return false;
  text = value.Scalar();
  return true;
}

void ConfigurationMap::read_or_same(std::string_view key, double& value, Interval allowed) {
  std::string text;
  if (scalar_text(key, text) && text == "same") {
    read(key, text);
  } else {
    read(key, value, allowed);
  }
}

ConfigurationDocument ConfigurationDocument::from_file(const std::string& file,
                                                       const std::vector<std::string>& overrides) {
  std::ifstream stream(file);
  if (!stream)
    throw ConfigurationError(file + ": cannot be read; give the path of a scenario file");
  std::ostringstream text;
  text << stream.rdbuf();
  return from_text(text.str(), file, overrides);
}

ConfigurationDocument ConfigurationDocument::from_text(const std::string& text,
                                                       const std::string& file_name,
                                                       const std::vector<std::string>& overrides) {
  ConfigurationDocument document;
  document.shared_ = std::make_shared<ConfigurationMap::Shared>();
  document.shared_->file_name = file_name;
  document.shared_->num_file_lines = count_lines(text);
  YAML::Node read;
  try {
    read.reset(one_document(text, file_name));
  } catch (const YAML::Exception& error) {
    throw ConfigurationError(document.shared_->place(error.mark) + ": not YAML: " + error.msg);
  }
  if (!read.IsDefined() || !read.IsMap()) {
    throw ConfigurationError(file_name + ":1:1: must be one YAML map of keys and values");
  }
  require_finite(read, file_name);
  document.shared_->document.reset(read);
  int line = document.shared_->num_file_lines;
  for (const std::string& assignment : overrides) {
    apply_override(document.shared_->document, assignment, line++);
    require_finite(document.shared_->document, "--set " + assignment);
  }
  document.shared_->overrides = overrides;
  return document;
}

ConfigurationMap ConfigurationDocument::root() {
  return {shared_, shared_->document, shared_->resolved, "", shared_->document.Mark()};
}

void ConfigurationDocument::forbid_files() {
  shared_->may_read_files = false;
}

void ConfigurationDocument::finish() {
  shared_->report_unknown(shared_->document, "");
  if (shared_->problems.empty()) return;
  std::stable_sort(
      shared_->problems.begin(), shared_->problems.end(), [](const auto& a, const auto& b) {
        return std::pair(a.first.line, a.first.column) < std::pair(b.first.line, b.first.column);
      });
  std::string text;
  for (const auto& [mark, problem] : shared_->problems) {
    text += (text.empty() ? "" : "\n") + shared_->place(mark) + ": " + problem;
  }
  if (shared_->num_untold > 0) {
    text += "\n" + shared_->file_name + ": and " + std::to_string(shared_->num_untold) +
            " more problems";
  }
  throw ConfigurationError(text);
}

std::string ConfigurationDocument::resolved_text() const {
  YAML::Emitter emitter;
  emitter << shared_->resolved;
  return std::string(emitter.c_str()) + "\n";
}

const std::string& ConfigurationDocument::file_name() const {
  return shared_->file_name;
}

}  // namespace holdfast
