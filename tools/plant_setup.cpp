#include "tools/plant_setup.h"

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
    network.problem("messages", std::to_string(layout.messages.size()) + " messages for " +
                                    std::to_string(setup.model.num_sensors()) + " sensors");
  }
  if (layout.signals.size() != 1) network.problem("signals", "a binary sensor has one signal");
}

void take_layout(const FrameLayout& layout, SystemSetup& setup, ConfigurationMap& network) {
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
      std::get<SystemSetup>(kind).options.read(map, this->system()->model(), folder);
    } else {
      for (const char* key : {"start_state", "start_step", "start_std", "signal_attacks"})
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
  return system() == nullptr || system()->model().problems().empty();
}

double PlantSetup::step_s() const {
  return system() != nullptr ? system()->model().step_s : binary_target()->model.step_s;
}

std::vector<std::string> PlantSetup::state_names() const {
  if (system() != nullptr) return system()->model().state_names;
  return BinaryTargetPlant(binary_target()->model, binary_target()->options, 0, 0).state_names();
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
    return std::make_unique<SignalAttackPlant>(system()->model(), system()->options, system()->rows,
                                               seed, run);
  }
  return std::make_unique<BinaryTargetPlant>(binary_target()->model, binary_target()->options, seed,
                                             run);
}

}  // namespace holdfast
