#include "tools/scenario_facts.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>

#include "common/configuration_text.h"
#include "common/errors.h"
#include "common/run_meta.h"
#include "common/status.h"
#include "tools/experiment.h"
#include "tools/printable_text.h"

namespace holdfast {
namespace {

constexpr std::size_t kListedNameBytesMax = 200;

// Elements of a list; none when the node is anything else.
YAML::Node items(const YAML::Node& node) {
  return node && node.IsSequence() ? node : YAML::Node(YAML::NodeType::Sequence);
}

template <class T>
T value_or(const YAML::Node& node, const T& fallback) {
  return node && node.IsScalar() ? node.as<T>(fallback) : fallback;
}

// Ours are short; a stranger's may not fill every table. Cut between characters of UTF-8.
std::string short_text(const YAML::Node& node) {
  auto text = value_or<std::string>(node, "");
  if (text.size() <= kListedNameBytesMax) return text;
  std::size_t end = kListedNameBytesMax;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80) --end;
  text.resize(end);
  return text;
}

YAML::Node child(const YAML::Node& node, const char* key) {
  const YAML::Node found = node.IsMap() ? node[key] : YAML::Node();
  return found ? found : YAML::Node();
}

std::string family_of(const YAML::Node& root) {
  YAML::Node shared(YAML::NodeType::Map);
  for (const auto& entry : root) {
    if (value_or<std::string>(entry.first, "") != "seed")
      shared.force_insert(entry.first, entry.second);
  }
  return scenario_hash(YAML::Dump(shared));
}

bool is_campaign_input(const std::string& input) {
  return input == "clean" || input == "authentic" || input == "told";
}

ScenarioFacts read_facts(const std::string& yaml, const std::string& place) {
  ScenarioFacts facts;
  const YAML::Node root = one_document(yaml, place + " (RUN_META)");
  if (!root.IsMap()) return facts;
  facts.num_steps = std::max<std::int64_t>(0, value_or<std::int64_t>(root["steps"], 0));
  for (const YAML::Node& name : items(root["state_names"]))
    facts.state_names.push_back(short_text(name));
  for (const YAML::Node& node : items(root["state_groups"])) {
    if (!node.IsMap() || facts.groups.size() == kListedMax) continue;
    StateGroup group;
    group.name = short_text(node["name"]);
    group.unit = short_text(node["unit"]);
    group.lost_above = value_or<double>(node["lost_above"], 0.0);
    if (!(group.lost_above >= 0.0)) group.lost_above = 0.0;
    for (const YAML::Node& state : items(node["states"])) {
      const auto index = value_or<std::int64_t>(state, -1);
      group.states.push_back(index < 0 || index > kNoState ? kNoState : static_cast<int>(index));
    }
    facts.groups.push_back(std::move(group));
  }
  for (const YAML::Node& node : items(root["estimators"])) {
    if (!node.IsMap() || facts.estimators.size() == kListedMax) continue;
    const auto name = short_text(node["name"]);
    const bool is_campaign_only = is_campaign_input(value_or<std::string>(node["input"], ""));
    facts.estimators.push_back({name, is_campaign_only, false});
    const YAML::Node smoother = node["smoother"];
    if (!smoother) continue;
    // With a lag a live run publishes it.
    const bool is_live = smoother.IsMap() && value_or<std::int64_t>(smoother["lag_steps"], 0) > 0;
    facts.estimators.push_back(
        {name + "_smoothed", is_campaign_only, !is_campaign_only && !is_live});
  }
  const YAML::Node campaign = child(root, "campaign");
  if (campaign.IsMap()) {
    const double threshold = value_or<double>(campaign["detection_threshold"], 0.5);
    if (threshold >= 0.0 && threshold <= 1.0) facts.detection_threshold = threshold;
    facts.mode_hold_steps = std::clamp<std::int64_t>(
        value_or<std::int64_t>(campaign["mode_hold_steps"], 1), 1, 1'000'000);
    const auto truth = value_or<std::string>(campaign["attack_truth"], "any");
    if (truth == "signals") facts.attack_truth = AttackTruth::kSignals;
    if (truth == "frames") facts.attack_truth = AttackTruth::kFrames;
  }
  facts.family = family_of(root);
  const YAML::Node model = child(child(root, "plant"), "model");
  if (!model.IsMap()) return facts;
  facts.step_s = value_or<double>(model["step_s"], 0.0);
  if (!std::isfinite(facts.step_s) || facts.step_s < 0.0) facts.step_s = 0.0;
  for (const YAML::Node& point : items(model["sensor_positions_m"])) {
    if (!point.IsSequence() || point.size() < 2) continue;
    facts.sensors.push_back({value_or<double>(point[0], NAN), value_or<double>(point[1], NAN)});
  }
  return facts;
}

}  // namespace

std::string state_label(const ScenarioFacts& facts, int state) {
  std::string unit;
  for (const StateGroup& group : facts.groups) {
    if (unit.empty() && std::ranges::find(group.states, state) != group.states.end())
      unit = group.unit;
  }
  // A name ends with its unit as identifiers write it: m/s becomes mps.
  std::string suffix = "_";
  for (const char c : unit) {
    if (c == '/') suffix += 'p';
    if (c != '/' && c != '^') suffix += c;
  }
  const bool has_name = state >= 0 && static_cast<std::size_t>(state) < facts.state_names.size();
  std::string label = has_name ? facts.state_names[static_cast<std::size_t>(state)]
                               : "state " + std::to_string(state);
  if (!unit.empty() && label.size() > suffix.size() && label.ends_with(suffix))
    label.resize(label.size() - suffix.size());
  std::ranges::replace(label, '_', ' ');
  return unit.empty() ? label : label + " [" + unit + "]";
}

ScenarioFacts read_scenario_facts(const std::string& yaml, const std::string& place) {
  try {
    return read_facts(yaml, place);
  } catch (const YAML::Exception& error) {
    throw UsageError(place +
                     ": the scenario in its RUN_META cannot be read: " + printable(error.what()));
  }
}

std::vector<std::string> campaign_only_channels(const ScenarioFacts& facts) {
  std::vector<std::string> channels;
  for (const ListedEstimator& listed : facts.estimators) {
    if (!listed.is_campaign_only) continue;
    channels.push_back(channel_name("EST_", listed.name));
    channels.push_back(channel_name("SMOOTHED_", listed.name));
  }
  return channels;
}

}  // namespace holdfast
