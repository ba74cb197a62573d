#include "tools/plant_setup.h"

#include <algorithm>

namespace holdfast {
namespace {

std::string kind_list() {
  std::string list = "binary_target";
  for (const std::string& name : SystemSource::kind_names()) list += ", " + name;
  return list;
}

void take_layout(const FrameLayout& layout, const BinaryTargetSetup& setup,
                 ConfigurationMap& network) {
  if (layout.messages.size() != setup.model.num_sensors()) {
    const bool has_sensors = layout.sensors.exist();
    network.problem(has_sensors ? "sensors" : "messages",
                    std::to_string(layout.messages.size()) +
                        (has_sensors ? " sensors for the " : " messages for ") +
                        std::to_string(setup.model.num_sensors()) +
                        (has_sensors ? " of the plant" : " sensors"));
  }
  if (layout.signals.size() != 1) network.problem("signals", "a binary sensor has one signal");
}

// Which measurements each message carries, where the scenario names them; false when it does not.
bool read_rows(const FrameLayout& layout, SystemSetup& setup, ConfigurationMap& network) {
  if (!network.has("measurements")) return false;
  const std::vector<std::string>& names = setup.model().measurement_names;
  std::vector<char> is_sent(names.size(), 0);
  for (ConfigurationMap& entry : network.maps("measurements")) {
    std::string message;
    std::vector<std::string> carried;
    entry.read("message", message);
    entry.read("carries", carried);
    const std::size_t source = setup.rows.size();
    if (source < layout.messages.size() && message != layout.messages[source]) {
      entry.problem("message", "must be '" + layout.messages[source] +
                                   "': one entry for each of the messages, in their order");
    }
    if (carried.size() != layout.signals.size()) {
      entry.problem("carries", "must name " + std::to_string(layout.signals.size()) +
                                   " measurements, one for each of the signals");
    }
    std::vector<int>& rows = setup.rows.emplace_back();
    for (const std::string& name : carried) {
      const auto found = std::find(names.begin(), names.end(), name);
      if (found == names.end() || is_sent[static_cast<std::size_t>(found - names.begin())] != 0) {
        entry.problem("carries",
                      "'" + name + "' is no measurement of the plant, or is sent already");
        continue;
      }
      is_sent[static_cast<std::size_t>(found - names.begin())] = 1;
      rows.push_back(static_cast<int>(found - names.begin()));
    }
  }
  if (setup.rows.size() != layout.messages.size() ||
      std::find(is_sent.begin(), is_sent.end(), 0) != is_sent.end()) {
    network.problem("measurements",
                    "must have one entry for each message, and each measurement once");
  }
  return true;
}

void take_layout(const FrameLayout& layout, SystemSetup& setup, ConfigurationMap& network) {
  if (layout.sensors.exist())
    network.problem("sensors", "are binary; this plant has vector readings: give messages");
  if (read_rows(layout, setup, network)) return;
  int row = 0;
  for (std::size_t source = 0; source < layout.messages.size(); ++source) {
    std::vector<int>& rows = setup.rows.emplace_back();
    for (std::size_t i = 0; i < layout.signals.size(); ++i) rows.push_back(row++);
  }
  if (row == setup.model().num_measurements()) return;
  network.problem("signals", std::to_string(layout.messages.size()) + " messages of " +
                                 std::to_string(layout.signals.size()) + " signals for " +
                                 std::to_string(setup.model().num_measurements()) +
                                 " measurements of the plant");
}

}  // namespace

void PlantSetup::read(ConfigurationMap map, const std::string& folder) {
  std::string name = "binary_target";
  map.read("kind", name);
  if (map.has("command")) map.read("command", command);
  SystemSetup system;
  if (system.source.set_kind(name)) {
    system.source.read(map.map("model"));
    kind = std::move(system);
    if (is_usable()) {
      auto& setup = std::get<SystemSetup>(kind);
      setup.source.modes.read(map);
      setup.options.read(map, setup.source.modes, folder);
    } else {
      for (const char* key : {"start_state", "start_step", "start_std", "signal_attacks",
                              "attack_gain", "inputs", "modes", "generated_modes", "mode_changes"})
        map.raw(key);
    }
    return;
  }
  if (name != "binary_target") {
    map.problem("kind", "'" + name + "' is none of: " + kind_list());
  }
  BinaryTargetSetup setup;
  setup.model.read(map.map("model"));
  setup.options.read(map, setup.model.num_sensors());
  kind = std::move(setup);
}

void PlantSetup::take_layout(const FrameLayout& layout, ConfigurationMap& network) {
  std::visit([&](auto& setup) { holdfast::take_layout(layout, setup, network); }, kind);
}

bool PlantSetup::is_usable() const {
  if (system() == nullptr) return true;
  const std::vector<SystemModel>& topologies = system()->source.modes.topologies;
  return !topologies.empty() &&
         std::all_of(topologies.begin(), topologies.end(),
                     [](const SystemModel& topology) { return topology.problems().empty(); });
}

double PlantSetup::step_s() const {
  return system() != nullptr ? system()->model().step_s : binary_target()->model.step_s;
}

std::vector<std::string> PlantSetup::state_names() const {
  if (system() != nullptr) return system()->model().state_names;
  return BinaryTargetPlant(binary_target()->model, binary_target()->options, 0, 0).state_names();
}

std::vector<std::string> PlantSetup::mode_names() const {
  return system() != nullptr ? system()->source.modes.names() : std::vector<std::string>();
}

std::vector<StateGroup> PlantSetup::default_groups() const {
  if (system() == nullptr) {
    return {{"position", {0, 2}, "m", 20.0}, {"velocity", {1, 3}, "m/s", 0.0}};
  }
  std::vector<StateGroup> groups;
  for (const SystemSource::Group& group : system()->source.groups()) {
    groups.push_back({group.name, group.states, group.unit, 0.0});
  }
  return groups;
}

std::unique_ptr<Plant> PlantSetup::make(std::uint64_t seed, std::uint32_t run) const {
  if (system() != nullptr) {
    return std::make_unique<SignalAttackPlant>(system()->source.modes, system()->options,
                                               system()->rows, seed, run);
  }
  return std::make_unique<BinaryTargetPlant>(binary_target()->model, binary_target()->options, seed,
                                             run);
}

}  // namespace holdfast
