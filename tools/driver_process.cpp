#include "tools/driver_process.h"

#include "common/measurement_messages.h"

namespace holdfast {

DriverProcess::DriverProcess(const Experiment& experiment, LcmLink& link,
                             const std::string& bus_url)
    : experiment_(experiment),
      link_(link),
      status_(link, "driver"),
      codec_(experiment.layout),
      command_codec_(experiment.layout),
      assembler_(codec_, experiment.assembler),
      radio_(experiment.make_radio_channel(0)),
      record_(link, "CAN_RX", bus_url, experiment.step_s()) {}

void DriverProcess::on_readable(CanBus& bus) {
  for (;;) {
    const std::size_t count = bus.read(batch_);
    for (std::size_t i = 0; i < count && !is_finished(); ++i) {
      if (period_ns_ > 0) close_until(batch_[i].receive_time_ns, bus);
      if (is_finished()) break;
      if (experiment_.record_frames) record_.add(batch_[i], assembler_.current_step());
      const MeasurementSet* closed = assembler_.on_frame(batch_[i]);
      if (closed == nullptr) continue;
      publish(*closed);
      send_commands(bus);
    }
    if (count < batch_.size() || is_finished()) return;
  }
}

void DriverProcess::close_until(std::int64_t stamp_ns, CanBus& bus) {
  if (next_close_ns_ == 0) next_close_ns_ = stamp_ns + period_ns_;
  for (; stamp_ns >= next_close_ns_ && !is_finished(); next_close_ns_ += period_ns_)
    close_step(bus);
}

void DriverProcess::close_step(CanBus& bus) {
  const MeasurementSet* closed = assembler_.close_step();
  if (closed == nullptr) return;
  publish(*closed);
  send_commands(bus);
}

void DriverProcess::send_commands(CanBus& bus) {
  if (!can_write_) return;
  if (!is_finished() && !assembler_.to_sensors().empty()) {
    status_.counter("sensor_requests") +=
        static_cast<std::int64_t>(bus.write(assembler_.to_sensors()));
  }
  for (const OperatorCommand& command : experiment_.commands) {
    if (command.after_step != set_.step || is_finished()) continue;
    const CanFrame frame = command_codec_.encode(command.change);
    status_.counter("commands_sent") += static_cast<std::int64_t>(bus.write({&frame, 1}));
  }
}

void DriverProcess::publish(const MeasurementSet& closed) {
  status_.set_state(ProcessState::kRunning);
  set_ = closed;
  if (radio_) radio_->apply(set_);
  to_message(set_, measurement_);
  link_.publish("MEASUREMENT", measurement_);
  flush_record();
}

void DriverProcess::publish_status(CanBus& bus) {
  const AssemblerCounters& frames = assembler_.counters();
  const BusCounters& counters = bus.counters();
  const std::pair<const char*, std::int64_t> values[] = {
      {"frames", frames.frames},
      {"packets", frames.packets},
      {"sensor_frames", frames.sensor_frames},
      {"invalid_readings", frames.invalid},
      {"unknown", frames.unknown},
      {"wrong_format", frames.wrong_format},
      {"non_finite", frames.non_finite},
      {"wrong_checksum", frames.wrong_checksum},
      {"wrong_counter", frames.wrong_counter},
      {"ticks", frames.ticks},
      {"odd_ticks", frames.odd_ticks},
      {"after_end", frames.after_end},
      {"sets", frames.sets},
      {"bus_kernel_dropped", counters.kernel_dropped},
      {"bus_refused", counters.refused},
      {"bus_write_dropped", counters.write_dropped},
      {"bus_error_frames", counters.error_frames},
      {"bus_times_down", counters.times_down}};
  for (const auto& [name, value] : values) status_.counter(name) = value;
  status_.set_step(assembler_.current_step() - 1);
  status_.publish();
}

}  // namespace holdfast
