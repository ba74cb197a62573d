#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "common/models/binary_target/binary_target_model.h"
#include "common/models/system_source.h"
#include "drivers/can/frame_codec.h"
#include "plant/binary_target_plant.h"
#include "plant/signal_attack_plant.h"
#include "tools/metrics/run_scores.h"

namespace holdfast {

/// A target among binary sensors: `kind: binary_target`.
struct BinaryTargetSetup {
  BinaryTargetModel model;
  BinaryTargetPlantOptions options;
};

/// A plant with vector measurements: every other kind (SystemSource).
struct SystemSetup {
  SystemSource source;
  SignalAttackPlantOptions options;
  std::vector<std::vector<int>> rows;  // rows of y that each source sends

  const SystemModel& model() const { return source.model; }
};

/// The plant of a scenario.
struct PlantSetup {
  std::string command;  // of an outside program; empty for ours
  std::variant<BinaryTargetSetup, SystemSetup> kind;

  /// Reads the block "plant". folder: that of the scenario file.
  void read(ConfigurationMap map, const std::string& folder);
  /// Takes the layout of the network: which rows of y each message carries, in the order of the
  /// messages and their signals. Reports what does not fit the plant on the network's map.
  void take_layout(const FrameLayout& layout, ConfigurationMap& network);

  /// False when the model that was read has problems: nothing can be built on it.
  bool is_usable() const;
  double step_s() const;
  std::vector<std::string> state_names() const;
  /// What a command can order; empty for a plant without modes.
  std::vector<std::string> mode_names() const;
  /// Groups of states for scenarios that name none.
  std::vector<StateGroup> default_groups() const;
  /// True for a plant whose attack signals say whether a step is attacked, whatever the frames do.
  bool has_vector_readings() const { return std::holds_alternative<SystemSetup>(kind); }
  const BinaryTargetSetup* binary_target() const { return std::get_if<BinaryTargetSetup>(&kind); }
  const SystemSetup* system() const { return std::get_if<SystemSetup>(&kind); }

  std::unique_ptr<Plant> make(std::uint64_t seed, std::uint32_t run) const;
};

}  // namespace holdfast
