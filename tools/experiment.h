#pragma once

#include <memory>
#include <string>
#include <vector>

#include "attacker/attack_rule.h"
#include "attacker/proxy_core.h"
#include "common/mode_change.h"
#include "drivers/can/frame_codec.h"
#include "drivers/measurement_assembler.h"
#include "drivers/radio_channel.h"
#include "estimators/estimator_session.h"
#include "tools/estimator_methods.h"
#include "tools/metrics/run_scores.h"
#include "tools/metrics/windows.h"
#include "tools/plant_setup.h"
#include "tools/sweep.h"

namespace holdfast {

/// Estimators, state groups, windows and their gaps that a scenario may list: each estimator and
/// group costs memory for each step.
inline constexpr std::size_t kListedMax = 64;

/// A command that the monitor's operator gives when a step closes.
struct OperatorCommand {
  std::int64_t after_step = 1;
  ModeChange change;
};

/// A scenario, read and checked: everything that a program needs to build its part.
struct Experiment {
  std::string name, description;
  std::int64_t seed = 1;
  std::int64_t num_steps = 100;
  double period_s = 0.02;  // live pace of a step; 0: as fast as the bus goes

  PlantSetup plant;

  std::string sensor_bus = "auto", monitor_bus = "auto";  // URLs, "auto", or both "none"
  FrameLayout layout;
  AssemblerOptions assembler;
  std::vector<OperatorCommand> commands;
  bool record_frames = true;

  std::vector<AttackRule> rules;
  std::vector<EstimatorEntry> estimators;
  std::vector<std::string> state_names;
  std::vector<StateGroup> state_groups;
  std::int64_t campaign_runs = 100;
  Sweep sweep;                                   // of campaigns
  double detection_threshold = 0.5;              // attack probability at which an attack is called
  std::vector<MetricsWindow> windows;            // of a campaign's metrics
  std::int64_t mode_hold_steps = 1;              // right in a row, until a mode counts as found
  AttackTruth attack_truth = AttackTruth::kAny;  // what makes a step count as attacked

  std::string resolved;  // YAML with every default written out, DBC text included

  bool has_bus() const { return sensor_bus != "none"; }
  double step_s() const { return plant.step_s(); }
  /// Numeric kernels of the estimators, for RUN_META: one name, or "name=kernel" for each when they
  /// differ. Equal bits are promised for equal kernels only.
  std::string kernel_text() const;
  /// Under which names a campaign scores our estimators, in order: each, then its smoothed
  /// estimates.
  std::vector<std::string> scored_names() const;
  /// u of a step, known to everyone; empty when the plant has none.
  Eigen::VectorXd known_input(std::int64_t step) const;
  /// The same as a function, which needs the experiment to stay where it is.
  EstimatorSession::KnownInput known_inputs() const {
    return [this](std::int64_t step) { return known_input(step); };
  }
  const EstimatorEntry& estimator(const std::string& estimator_name) const;  // throws UsageError
  const EstimatorEntry* find_estimator(const std::string& estimator_name) const;  // null: none

  std::unique_ptr<Plant> make_plant(std::uint32_t run) const;
  std::unique_ptr<Estimator> make_estimator(const EstimatorEntry& entry, std::uint32_t run) const;
  /// may_change: rules that the scenario has not may come while it runs.
  ProxyCore make_proxy(std::uint32_t run, bool may_change = false) const;
  /// Null when the scenario has no radio channel.
  std::unique_ptr<RadioChannel> make_radio_channel(std::uint32_t run) const;
};

/// Why the rule cannot stay unnoticed; empty for one that can, or does not want to.
std::string stealth_fault(const AttackRule& rule, const Experiment& experiment);

/// Reads a scenario file. Throws ConfigurationError with every problem; overrides as "a.b=value".
Experiment load_experiment(const std::string& file, const std::vector<std::string>& overrides = {});
/// The same for text, such as RUN_META's; `place` stands for the file name in messages.
Experiment experiment_from_text(const std::string& text, const std::string& place);

}  // namespace holdfast
