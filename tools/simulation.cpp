#include "tools/simulation.h"

#include "common/clock.h"

namespace holdfast {

Simulation::Simulation(const Experiment& experiment, std::uint32_t run)
    : experiment_(experiment),
      codec_(experiment.layout),
      plant_(experiment.make_plant(run)),
      proxy_(experiment.make_proxy(run)),
      assembler_(codec_, experiment.assembler),
      clean_assembler_(codec_, experiment.assembler),
      radio_(experiment.make_radio_channel(run)) {
  for (const EstimatorEntry& entry : experiment.estimators) {
    if (entry.is_outside()) continue;
    entries_.push_back(&entry);
    estimators_.push_back(experiment.make_estimator(entry, run));
    needs_clean_ = needs_clean_ || entry.input == EstimatorEntry::Input::kClean;
  }
  estimates_.resize(entries_.size(), nullptr);
}

void Simulation::pass_bus(const std::vector<std::vector<double>>& readings,
                          MeasurementAssembler& assembler, bool is_attacked, MeasurementSet& set) {
  const auto deliver = [&](const CanFrame& frame) {
    const MeasurementSet* closed = assembler.on_frame(frame);
    if (closed == nullptr) return;
    set = *closed;
    if (radio_) radio_->apply(set);
  };
  std::size_t delivered = sent_.size();
  const auto pass = [&](const CanFrame& frame) {
    if (!is_attacked || !experiment_.has_bus()) return deliver(frame);
    proxy_.on_frame(frame, sent_, records_);
    for (; delivered < sent_.size(); ++delivered) deliver(sent_[delivered]);
  };
  for (std::size_t source = 0; source < readings.size(); ++source) {
    pass(codec_.encode(static_cast<int>(source), readings[source], step_));
  }
  pass(codec_.encode_tick(step_));
  if (experiment_.assembler.closed_by_tick) return;
  // Where the driver's own clock closes steps, a simulated one ticks exactly with the plant's.
  const MeasurementSet* closed = assembler.close_step();
  if (closed == nullptr) return;
  set = *closed;
  if (radio_) radio_->apply(set);
}

bool Simulation::advance() {
  if (step_ >= experiment_.num_steps) return false;
  ++step_;
  truth_ = &plant_->advance();
  sent_.clear();
  records_.clear();
  pass_bus(truth_->readings, assembler_, true, received_);
  if (needs_clean_) pass_bus(truth_->clean_readings, clean_assembler_, false, clean_);
  for (std::size_t i = 0; i < estimators_.size(); ++i) {
    const bool is_clean = entries_[i]->input == EstimatorEntry::Input::kClean;
    const std::int64_t started_ns = on_step_time ? monotonic_time_ns() : 0;
    estimates_[i] = &estimators_[i]->step(step_, is_clean ? clean_ : received_, known_input_);
    if (on_step_time) on_step_time(i, monotonic_time_ns() - started_ns);
  }
  return true;
}

}  // namespace holdfast
