#pragma once

#include <array>
#include <functional>
#include <memory>
#include <unordered_set>
#include <vector>

#include "drivers/can/command_codec.h"
#include "drivers/can/reading_encoder.h"
#include "tools/bounds/clairvoyant_filter.h"
#include "tools/bus_inputs.h"
#include "tools/experiment.h"

namespace holdfast {

/// One run of an experiment in process, without bus or clock: the same plant, codec, attacker core,
/// assembler, radio channel and estimators as the live processes.
class Simulation {
 public:
  /// Estimators that are outside commands are left out.
  Simulation(const Experiment& experiment, std::uint32_t run);

  /// Told how long each estimator's step took, by its index and in ns. May be empty.
  std::function<void(std::size_t, std::int64_t)> on_step_time;

  /// Takes the next step; false after the last one.
  bool advance();

  const PlantStep& truth() const { return *truth_; }
  /// Z_k as received, radio channel included.
  const MeasurementSet& measurements() const { return received_; }
  /// The i-th entry's estimator.
  Estimator& estimator(std::size_t i) { return *estimators_[i]; }
  const std::vector<const EstimatorEntry*>& entries() const { return entries_; }
  /// Packets of the step that no rule touched.
  std::int64_t num_authentic() const;
  /// True when a signal attack acts in this step.
  bool has_signal_attack() const;
  /// All attack signals of the step, one after the other, with what rules added to sensors.
  const std::vector<double>& true_attack() const { return true_attack_; }
  /// What the modes of estimators are scored against: the plant's mode, or what was done to frames
  /// where the scenario's attack_truth is those.
  int true_mode() const;
  /// True when the step counts as attacked, as the scenario's attack_truth says.
  bool is_attacked() const;
  /// estimates()[i] belongs to entries()[i].
  const std::vector<const Estimate*>& estimates() const { return estimates_; }
  /// Of this step, about what goes to the monitor; commands have their own.
  const std::vector<AttackRecord>& attack_records() const { return sent_.records; }
  const std::vector<AttackRecord>& command_records() const { return sent_.command_records; }
  const std::vector<RuleSignal>& rule_signals() const { return sent_.signals; }  // of this step
  const std::vector<CanFrame>& sent_frames() const { return sent_.frames; }      // of this step
  const std::vector<CanFrame>& commands() const { return sent_.commands; }       // of this step
  const AssemblerCounters& assembler_counters() const { return assembler_.counters(); }
  /// What became of those, by CommandOutcome.
  const std::array<std::int64_t, 3>& command_outcomes() const { return command_outcomes_; }

 private:
  void pass_bus(MeasurementAssembler& assembler, bool has_attacker, MeasurementSet& set);
  void pass_commands();
  void collect_attack();
  bool is_authentic(const Packet& packet) const;
  void keep_authentic();
  AttackHypothesis done_to_frames() const;
  const MeasurementSet& input_of(const EstimatorEntry& entry) const;

  const Experiment& experiment_;
  FrameCodec codec_;
  CommandCodec command_codec_;
  ReadingEncoder encoder_, clean_encoder_;
  std::vector<CanFrame> frames_;  // of the plant, of one step
  std::unique_ptr<Plant> plant_;
  ProxyCore proxy_;
  MeasurementAssembler assembler_, clean_assembler_;
  std::unique_ptr<RadioChannel> radio_;
  std::vector<const EstimatorEntry*> entries_;
  std::vector<std::unique_ptr<Estimator>> estimators_;
  std::vector<ToldEstimator*> told_;  // those of estimators_ that are
  std::vector<const Estimate*> estimates_;
  const PlantStep* truth_ = nullptr;
  MeasurementSet received_, clean_, authentic_;
  bool needs_clean_ = false, needs_authentic_ = false;
  ProxyOutput sent_;
  std::unordered_set<std::int64_t> touched_;  // tx indices of the run; of sensors that keep a state
  std::array<std::int64_t, 3> command_outcomes_{};
  BusInputs bus_inputs_;
  std::vector<double> true_attack_;
  Eigen::VectorXd known_input_;
  std::int64_t step_ = 0;
};

}  // namespace holdfast
