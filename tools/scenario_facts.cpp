#include "tools/scenario_facts.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>

#include "common/errors.h"
#include "common/status.h"
#include "tools/printable_text.h"

namespace holdfast {
namespace {

// Elements of a list; none when the node is anything else.
YAML::Node items(const YAML::Node& node) {
  return node && node.IsSequence() ? node : YAML::Node(YAML::NodeType::Sequence);
}

template <class T>
T value_or(const YAML::Node& node, const T& fallback) {
  return node && node.IsScalar() ? node.as<T>(fallback) : fallback;
}

ScenarioFacts read_facts(const std::string& yaml) {
  ScenarioFacts facts;
  const YAML::Node root = YAML::Load(yaml);
  if (!root.IsMap()) return facts;
  facts.num_steps = std::max<std::int64_t>(0, value_or<std::int64_t>(root["steps"], 0));
  for (const YAML::Node& name : items(root["state_names"]))
    facts.state_names.push_back(value_or<std::string>(name, ""));
  for (const YAML::Node& node : items(root["state_groups"])) {
    if (!node.IsMap()) continue;
    StateGroupFacts group{
        value_or<std::string>(node["name"], ""), value_or<std::string>(node["unit"], ""), {}};
    for (const YAML::Node& state : items(node["states"])) {
      group.states.push_back(static_cast<std::size_t>(value_or<std::int64_t>(state, -1)));
    }
    facts.groups.push_back(std::move(group));
  }
  for (const YAML::Node& node : items(root["estimators"])) {
    if (!node.IsMap()) continue;
    facts.estimators.emplace_back(value_or<std::string>(node["name"], ""),
                                  value_or<std::string>(node["input"], "") == "clean");
  }
  const YAML::Node plant = root["plant"];
  const YAML::Node model = plant && plant.IsMap() ? plant["model"] : YAML::Node();
  if (!model || !model.IsMap()) return facts;
  for (const YAML::Node& place : items(model["sensor_positions_m"])) {
    if (!place.IsSequence() || place.size() < 2) continue;
    facts.sensors.push_back({value_or<double>(place[0], NAN), value_or<double>(place[1], NAN)});
  }
  return facts;
}

}  // namespace

ScenarioFacts read_scenario_facts(const std::string& yaml, const std::string& place) {
  try {
    return read_facts(yaml);
  } catch (const YAML::Exception& error) {
    throw UsageError(place +
                     ": the scenario in its RUN_META cannot be read: " + printable(error.what()));
  }
}

std::vector<std::string> campaign_only_channels(const std::string& scenario) {
  std::vector<std::string> channels;
  try {
    for (const auto& [name, is_campaign_only] : read_facts(scenario).estimators) {
      if (is_campaign_only) channels.push_back(channel_name("EST_", name));
    }
  } catch (const YAML::Exception&) {
    return {};
  }
  return channels;
}

}  // namespace holdfast
