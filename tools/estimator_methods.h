#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "attacker/attack_rule.h"
#include "common/models/binary_target/binary_target_model.h"
#include "estimators/estimator.h"
#include "estimators/secure_particle_filter.h"
#include "estimators/smoothed_stream.h"
#include "tools/plant_setup.h"

namespace holdfast {

/// One estimator of a scenario: one of ours, or an outside command.
struct EstimatorEntry {
  /// kClean: what the sensors would have sent; kAuthentic: the packets that no rule touched, and
  /// whether a signal attack acts; kTold: what was received, and what was done to it. All but the
  /// first in campaigns only.
  enum class Input { kReceived, kClean, kAuthentic, kTold };

  std::string name;
  std::string command;  // of an outside program; empty for ours
  std::string method;
  Input input = Input::kReceived;
  std::vector<int> own_modes;  // by the plant's modes; empty for a method without modes by name
  std::vector<std::string> mode_names;  // of its own modes; empty likewise
  std::string kernel;                   // numeric kernel that it computes with
  bool is_smoothed = false;             // its smoothed estimates are wanted too
  std::int64_t lag_steps = 0;           // of them; 0: at the end of the run, by all of it
  /// Makes the estimator of one run from the scenario's seed; empty for an outside program.
  std::function<std::unique_ptr<Estimator>(std::uint64_t seed, std::uint32_t run)> make;

  bool is_outside() const { return !command.empty(); }
  /// Index among this estimator's modes of one of the plant's, -1 for one that it does not believe
  /// in; the same where it has no modes by name.
  int own_mode(int plant_mode) const;
  /// Name under which the smoothed estimates are scored.
  std::string smoothed_name() const { return name + "_smoothed"; }
  bool is_campaign_only() const { return input != Input::kReceived; }
};

/// What a method's reader may know of the scenario.
struct MethodContext {
  const PlantSetup& plant;
  const FrameLayout& layout;
  const std::vector<AttackRule>& rules;  // none when the scenario has no bus
};

/// Makes the secure particle filter of one run.
struct SecureParticleFilterMaker {
  BinaryTargetModel model;  // what the estimator believes; the plant's unless overridden
  BinaryTargetModel::Attack assumes;
  SecureParticleFilterOptions options;

  std::unique_ptr<Estimator> operator()(std::uint64_t seed, std::uint32_t run) const;
};

/// The stream of smoothed estimates of an entry that wants them with a fixed lag; none for others,
/// which look back when the run is over. The estimator must not have taken a step yet.
std::optional<SmoothedStream> fixed_lag_stream(const EstimatorEntry& entry, Estimator& estimator);

/// Reads method, input and the method's own keys. Reports a method that is not there or does not
/// fit the plant.
void read_method(ConfigurationMap& map, const MethodContext& context, EstimatorEntry& entry);

}  // namespace holdfast
