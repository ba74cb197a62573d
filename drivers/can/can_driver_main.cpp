#include <array>
#include <holdfast/can_frames_t.hpp>
#include <holdfast/measurement_set_t.hpp>

#include "common/measurement_messages.h"
#include "common/pacer.h"
#include "common/status.h"
#include "drivers/can/can_bus.h"
#include "drivers/can/can_messages.h"
#include "drivers/event_loop.h"
#include "tools/program_options.h"

namespace holdfast {
namespace {

constexpr std::size_t kRecordBatchMax = 256;

// Frames of the monitor-side bus in, measurement sets out.
class DriverProcess {
 public:
  DriverProcess(const Experiment& experiment, LcmLink& link, const std::string& bus_url)
      : experiment_(experiment), link_(link), status_(link, "driver"), codec_(experiment.layout),
        assembler_(codec_, experiment.assembler), radio_(experiment.make_radio_channel(0)) {
    record_.bus = bus_url;
  }

  StatusReporter& status() { return status_; }
  bool is_finished() const { return assembler_.is_finished(); }

  void on_readable(CanBus& bus) {
    for (;;) {
      const std::size_t count = bus.read(batch_);
      for (std::size_t i = 0; i < count && !is_finished(); ++i) {
        record(batch_[i]);
        const MeasurementSet* closed = assembler_.on_frame(batch_[i]);
        if (closed != nullptr) publish(*closed);
      }
      if (count < batch_.size() || is_finished()) return;
    }
  }

  void close_step() { publish(*assembler_.close_step()); }

  void publish_status(CanBus& bus) {
    const AssemblerCounters& frames = assembler_.counters();
    const BusCounters& counters = bus.counters();
    const std::pair<const char*, std::int64_t> values[] = {
        {"frames", frames.frames}, {"packets", frames.packets}, {"unknown", frames.unknown},
        {"wrong_format", frames.wrong_format}, {"non_finite", frames.non_finite},
        {"wrong_counter", frames.wrong_counter}, {"ticks", frames.ticks}, {"odd_ticks", frames.odd_ticks},
        {"after_end", frames.after_end}, {"sets", frames.sets},
        {"bus_kernel_dropped", counters.kernel_dropped}, {"bus_refused", counters.refused},
        {"bus_error_frames", counters.error_frames}, {"bus_times_down", counters.times_down}};
    for (const auto& [name, value] : values) status_.counter(name) = value;
    status_.set_step(assembler_.current_step() - 1);
    status_.publish();
  }

  void flush_record() {
    if (record_.frames.empty()) return;
    record_.step = assembler_.current_step();
    record_.utime = 0;
    record_.num_frames = static_cast<std::int32_t>(record_.frames.size());
    link_.publish("CAN_RX", record_);
    record_.frames.clear();
  }

 private:
  void record(const CanFrame& frame) {
    if (!experiment_.record_frames) return;
    to_message(frame, rx_index_++, record_.frames.emplace_back());
    if (record_.frames.size() >= kRecordBatchMax) flush_record();
  }

  void publish(const MeasurementSet& closed) {
    set_ = closed;
    if (radio_) radio_->apply(set_);
    to_message(set_, measurement_);
    link_.publish("MEASUREMENT", measurement_);
    flush_record();
  }

  const Experiment& experiment_;
  LcmLink& link_;
  StatusReporter status_;
  FrameCodec codec_;
  MeasurementAssembler assembler_;
  std::unique_ptr<RadioChannel> radio_;
  std::array<CanFrame, 64> batch_;
  std::int64_t rx_index_ = 0;
  MeasurementSet set_;
  measurement_set_t measurement_;
  can_frames_t record_;
};

int run(const ProgramOptions& options, const std::string& bus_url) {
  const Experiment experiment = options.load();
  LcmLink link(options.lcm_url);
  DriverProcess driver(experiment, link, bus_url);
  BusOptions bus_options;
  bus_options.on_event = [&driver](const std::string& event) { driver.status().remark(event); };
  const std::unique_ptr<CanBus> bus = open_can_bus(bus_url, bus_options);

  EventLoop loop;
  bool is_stopped = false;
  loop.watch_bus(*bus, [&] {
    driver.on_readable(*bus);
    // A recorded bus may end before the run that it holds.
    if (driver.is_finished() || bus->at_end()) loop.stop();
  });
  std::unique_ptr<Pacer> clock;
  if (!experiment.assembler.closed_by_tick) {
    clock = std::make_unique<Pacer>(std::max(experiment.period_s, 1e-6));
    loop.watch(clock->file_descriptor(), [&] {
      for (std::int64_t due = clock->acknowledge(); due > 0 && !driver.is_finished(); --due) driver.close_step();
      if (driver.is_finished()) loop.stop();
    });
  }
  loop.every(0.25, [&] { driver.publish_status(*bus); });
  loop.on_stop_signal([&] {
    is_stopped = true;
    loop.stop();
  });
  driver.status().set_state(ProcessState::kReady);
  driver.publish_status(*bus);
  loop.run();
  driver.flush_record();
  const bool is_complete = driver.is_finished();
  driver.status().set_state(is_complete ? ProcessState::kFinished : ProcessState::kFailed);
  if (!is_complete) driver.status().remark(is_stopped ? "stopped before the last step" : bus_url + " ended before the last step");
  driver.publish_status(*bus);
  return is_complete ? 0 : 1;
}

}  // namespace
}  // namespace holdfast

int main(int argc, char** argv) {
  CLI::App app{"Reads the monitor-side bus and publishes the measurement set of each step on MEASUREMENT."};
  app.footer("Example:\n  holdfast-can-driver scenarios/binary_tracking.yaml --bus socketcan:vcan1");
  holdfast::ProgramOptions options;
  std::string bus;
  options.add_scenario(app);
  options.add_lcm(app);
  app.add_option("--bus", bus, "Monitor-side bus URL (opened read-only)")->required();
  const int status = holdfast::parse_command_line(app, "holdfast-can-driver", argc, argv);
  if (status >= 0) return status;
  return holdfast::run_program("holdfast-can-driver", [&] { return holdfast::run(options, bus); });
}
