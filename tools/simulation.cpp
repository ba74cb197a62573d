#include "tools/simulation.h"

#include <algorithm>

#include "common/clock.h"
#include "tools/frame_truth.h"

namespace holdfast {

Simulation::Simulation(const Experiment& experiment, std::uint32_t run)
    : experiment_(experiment),
      codec_(experiment.layout),
      command_codec_(experiment.layout),
      encoder_(codec_),
      clean_encoder_(codec_),
      plant_(experiment.make_plant(run)),
      proxy_(experiment.make_proxy(run)),
      assembler_(codec_, experiment.assembler),
      clean_assembler_(codec_, experiment.assembler),
      radio_(experiment.make_radio_channel(run)),
      bus_inputs_(experiment.plant, codec_, experiment.assembler.check_counter) {
  for (const EstimatorEntry& entry : experiment.estimators) {
    if (entry.is_outside()) continue;
    entries_.push_back(&entry);
    estimators_.push_back(experiment.make_estimator(entry, run));
    auto* told = dynamic_cast<ToldEstimator*>(estimators_.back().get());
    if (told != nullptr) told_.push_back(told);
    needs_clean_ = needs_clean_ || entry.input == EstimatorEntry::Input::kClean;
    needs_authentic_ = needs_authentic_ || entry.input == EstimatorEntry::Input::kAuthentic;
  }
  estimates_.resize(entries_.size(), nullptr);
}

void Simulation::pass_bus(MeasurementAssembler& assembler, bool has_attacker, MeasurementSet& set) {
  const auto deliver = [&](const CanFrame& frame) {
    const MeasurementSet* closed = assembler.on_frame(frame);
    if (closed == nullptr) return;
    set = *closed;
    if (radio_) radio_->apply(set);
  };
  std::size_t delivered = sent_.frames.size();
  const auto pass = [&](const CanFrame& frame) {
    if (!has_attacker || !experiment_.has_bus()) return deliver(frame);
    proxy_.on_frame(frame, sent_);
    for (; delivered < sent_.frames.size(); ++delivered) deliver(sent_.frames[delivered]);
  };
  for (const CanFrame& frame : frames_) pass(frame);
  if (experiment_.assembler.closed_by_tick) return;
  // Where the driver's own clock closes steps, a simulated one ticks exactly with the plant's.
  const MeasurementSet* closed = assembler.close_step();
  if (closed == nullptr) return;
  set = *closed;
  if (radio_) radio_->apply(set);
}

// The operator sees the step close and may answer; what the plant then hears, it has in time for
// the next step, since a simulated bus takes none.
void Simulation::pass_commands() {
  const auto send_back = [this](const CanFrame& frame) {
    if (experiment_.has_bus()) {
      proxy_.on_monitor_frame(frame, sent_);
    } else {
      sent_.commands.push_back(frame);
    }
  };
  // In the order of the driver.
  for (const CanFrame& frame : assembler_.to_sensors()) send_back(frame);
  for (const OperatorCommand& command : experiment_.commands) {
    if (command.after_step == step_ && step_ != experiment_.num_steps)
      send_back(command_codec_.encode(command.change));
  }
  command_outcomes_ = {};
  // Nobody is there any more to obey: the plant ends with its last step.
  if (step_ == experiment_.num_steps) sent_.commands.clear();
  // What is for sensors is no command.
  std::erase_if(sent_.commands, [this](const CanFrame& frame) {
    if (command_codec_.has_identifier(frame)) return false;
    encoder_.on_frame(frame);
    return true;
  });
  for (const CanFrame& frame : sent_.commands) {
    const std::optional<ModeChange> command = command_codec_.decode(frame);
    const CommandOutcome outcome = command ? plant_->obey(*command) : CommandOutcome::kRefused;
    ++command_outcomes_[static_cast<std::size_t>(outcome)];
  }
}

void Simulation::collect_attack() {
  true_attack_.clear();
  for (const AttackSignal& signal : truth_->attack_signals)
    true_attack_.insert(true_attack_.end(), signal.value.begin(), signal.value.end());
  if (!bus_inputs_.exists()) return;
  for (const AttackRecord& record : sent_.records) {
    if (record.disposition == AttackRecord::Disposition::kAltered)
      bus_inputs_.add(record.step, record.original, record.forwarded, true_attack_);
  }
}

// The simulated buses lose nothing, so the nth frame sent is the nth one received.
bool Simulation::is_authentic(const Packet& packet) const {
  // A state may rest on a frame of many steps ago.
  if (touched_.contains(packet.rx_index)) return false;
  return std::ranges::none_of(
      sent_.records, [&packet](const AttackRecord& r) { return r.tx_index == packet.rx_index; });
}

std::int64_t Simulation::num_authentic() const {
  return std::ranges::count_if(received_.packets,
                               [this](const Packet& packet) { return is_authentic(packet); });
}

void Simulation::keep_authentic() {
  authentic_.clear(received_.step, received_.utime);
  authentic_.seq = received_.seq;
  for (const Packet& packet : received_.packets) {
    if (is_authentic(packet)) authentic_.add(packet, received_.values_of(packet));
  }
}

const MeasurementSet& Simulation::input_of(const EstimatorEntry& entry) const {
  switch (entry.input) {
    case EstimatorEntry::Input::kClean:
      return clean_;
    case EstimatorEntry::Input::kAuthentic:
      return authentic_;
    case EstimatorEntry::Input::kReceived:
    case EstimatorEntry::Input::kTold:
      break;
  }
  return received_;
}

AttackHypothesis Simulation::done_to_frames() const {
  std::uint32_t actions = 0;
  for (const AttackRecord& record : sent_.records) actions |= record.actions;
  return true_hypothesis(actions);
}

int Simulation::true_mode() const {
  return experiment_.attack_truth == AttackTruth::kFrames ? static_cast<int>(done_to_frames())
                                                          : truth_->mode;
}

bool Simulation::has_signal_attack() const {
  const auto acts = [](double value) { return value != 0.0; };
  return std::ranges::any_of(truth_->attack_signals, [&acts](const AttackSignal& signal) {
    return std::ranges::any_of(signal.value, acts);
  });
}

bool Simulation::is_attacked() const {
  switch (experiment_.attack_truth) {
    case AttackTruth::kSignals:
      return has_signal_attack();
    case AttackTruth::kFrames:
      return !sent_.records.empty();
    case AttackTruth::kAny:
      break;
  }
  return !sent_.records.empty() || has_signal_attack();
}

bool Simulation::advance() {
  if (step_ >= experiment_.num_steps) return false;
  ++step_;
  truth_ = &plant_->advance();
  sent_.clear();
  frames_.clear();
  encoder_.encode(step_, truth_->readings, frames_);
  pass_bus(assembler_, true, received_);
  if (needs_clean_) {
    frames_.clear();
    clean_encoder_.encode(step_, truth_->clean_readings, frames_);
    pass_bus(clean_assembler_, false, clean_);
    for (const CanFrame& frame : clean_assembler_.to_sensors()) clean_encoder_.on_frame(frame);
  }
  pass_commands();
  if (experiment_.layout.sensors.exist()) {
    for (const AttackRecord& record : sent_.records) {
      if (record.tx_index >= 0) touched_.insert(record.tx_index);
    }
  }
  collect_attack();
  if (needs_authentic_) keep_authentic();
  for (ToldEstimator* told : told_) {
    told->tell({has_signal_attack(), truth_->mode, done_to_frames()});
  }
  known_input_ = experiment_.known_input(step_);
  for (std::size_t i = 0; i < estimators_.size(); ++i) {
    const std::int64_t started_ns = on_step_time ? monotonic_time_ns() : 0;
    estimates_[i] = &estimators_[i]->step(step_, input_of(*entries_[i]), known_input_);
    if (on_step_time) on_step_time(i, monotonic_time_ns() - started_ns);
  }
  return true;
}

}  // namespace holdfast
