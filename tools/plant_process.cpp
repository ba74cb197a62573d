#include "tools/plant_process.h"

#include <cmath>

#include "common/measurement_messages.h"
#include "plant/truth_messages.h"

namespace holdfast {

PlantProcess::PlantProcess(const Experiment& experiment, CanBus* bus, const std::string& bus_url,
                           LcmLink& link)
    : experiment_(experiment),
      bus_(bus),
      link_(link),
      status_(link, "plant"),
      plant_(experiment.make_plant(0)),
      codec_(experiment.layout),
      encoder_(codec_),
      command_codec_(experiment.layout),
      command_record_(link, "CAN_COMMAND", bus_url, experiment.step_s()),
      assembler_(codec_, experiment.assembler),
      radio_(experiment.make_radio_channel(0)) {}

void PlantProcess::on_readable() {
  for (std::size_t count = batch_.size(); count == batch_.size();) {
    count = bus_->read(batch_);
    for (std::size_t i = 0; i < count; ++i) {
      if (command_codec_.has_identifier(batch_[i])) {
        obey(batch_[i]);
      } else {
        encoder_.on_frame(batch_[i]);
      }
    }
  }
}

void PlantProcess::obey(const CanFrame& frame) {
  const std::optional<ModeChange> command = command_codec_.decode(frame);
  const CommandOutcome outcome = command ? plant_->obey(*command) : CommandOutcome::kRefused;
  ++status_.counter("commands");
  if (outcome == CommandOutcome::kLate) ++status_.counter("late_commands");
  if (outcome == CommandOutcome::kRefused) ++status_.counter("refused_commands");
  if (!experiment_.record_frames) return;
  // By the step at which it acts: when it came is not the same in every run.
  const std::int64_t step = command ? command->from_step : 0;
  command_record_.add(frame, step);
  command_record_.flush(step);
}

bool PlantProcess::advance() {
  // What is on its way is for this step already; without commands nothing on the bus is waited for.
  if (bus_ != nullptr && experiment_.layout.has_way_back()) on_readable();
  const PlantStep& step = plant_->advance();
  publish_truth(step);
  publish_known_input(step.step);
  frames_.clear();
  encoder_.encode(step.step, step.readings, frames_);
  if (bus_ != nullptr) {
    send();
  } else {
    publish_measurements();
    for (const OperatorCommand& command : experiment_.commands) {
      if (command.after_step == step.step && step.step < experiment_.num_steps)
        obey(command_codec_.encode(command.change));
    }
  }
  status_.set_step(step.step);
  return step.step < experiment_.num_steps;
}

std::int64_t PlantProcess::utime_of(std::int64_t step) const {
  return std::llround(static_cast<double>(step) * experiment_.step_s() * 1e6);
}

void PlantProcess::publish_truth(const PlantStep& step) {
  const std::int64_t utime = utime_of(step.step);
  to_message(step, utime, truth_);
  link_.publish("PLANT_TRUTH", truth_);
  for (const AttackSignal& signal : step.attack_signals) {
    to_message(signal, step.step, utime, attack_signal_);
    link_.publish("ATTACK_SIGNAL", attack_signal_);
  }
}

void PlantProcess::publish_known_input(std::int64_t step) {
  if (!to_message(experiment_.known_input(step), step, utime_of(step), known_input_)) return;
  link_.publish("KNOWN_INPUT", known_input_);
}

void PlantProcess::send() {
  status_.counter("frames_sent") += static_cast<std::int64_t>(bus_->write(frames_));
  const BusCounters& bus = bus_->counters();
  status_.counter("bus_write_dropped") = bus.write_dropped;
  if (experiment_.layout.has_way_back()) {
    status_.counter("bus_kernel_dropped") = bus.kernel_dropped;
    status_.counter("bus_refused") = bus.refused;
  }
  status_.counter("bus_times_down") = bus.times_down;
}

void PlantProcess::publish_measurements() {
  const MeasurementSet* closed = nullptr;
  for (const CanFrame& frame : frames_) closed = assembler_.on_frame(frame);
  if (closed == nullptr) closed = assembler_.close_step();  // not closed by the tick
  if (closed == nullptr) return;
  for (const CanFrame& frame : assembler_.to_sensors()) encoder_.on_frame(frame);
  MeasurementSet set = *closed;
  if (radio_) radio_->apply(set);
  to_message(set, measurement_);
  link_.publish("MEASUREMENT", measurement_);
}

}  // namespace holdfast
