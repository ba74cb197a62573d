#include <algorithm>
#include <array>
#include <cmath>
#include <holdfast/attack_signal_t.hpp>
#include <holdfast/measurement_set_t.hpp>
#include <holdfast/truth_t.hpp>

#include "common/measurement_messages.h"
#include "common/pacer.h"
#include "common/status.h"
#include "drivers/can/can_bus.h"
#include "drivers/event_loop.h"
#include "plant/truth_messages.h"
#include "tools/program_options.h"

namespace holdfast {
namespace {

// One step of the plant on the bus: truth to its own channel, frames, then the tick that ends the step.
class PlantProcess {
 public:
  PlantProcess(const Experiment& experiment, CanBus* bus, LcmLink& link)
      : experiment_(experiment), bus_(bus), link_(link), status_(link, "plant"),
        plant_(experiment.make_plant(0)), codec_(experiment.layout),
        assembler_(codec_, experiment.assembler), radio_(experiment.make_radio_channel(0)) {}

  StatusReporter& status() { return status_; }

  bool advance() {
    const PlantStep& step = plant_->advance();
    const std::int64_t utime =
        std::llround(static_cast<double>(step.step) * experiment_.model.step_s * 1e6);
    to_message(step, utime, truth_);
    link_.publish("PLANT_TRUTH", truth_);
    for (const AttackSignal& signal : step.attack_signals) {
      if (std::all_of(signal.value.begin(), signal.value.end(), [](double v) { return v == 0.0; })) continue;
      to_message(signal, step.step, utime, attack_signal_);
      link_.publish("ATTACK_SIGNAL", attack_signal_);
    }
    frames_.clear();
    for (std::size_t s = 0; s < step.readings.size(); ++s) {
      frames_.push_back(codec_.encode(static_cast<int>(s), step.readings[s], step.step));
    }
    frames_.push_back(codec_.encode_tick(step.step));
    if (bus_ != nullptr) {
      send();
    } else {
      publish_measurements();
    }
    status_.set_step(step.step);
    return step.step < experiment_.num_steps;
  }

 private:
  void send() {
    status_.counter("frames_sent") += static_cast<std::int64_t>(bus_->write(frames_));
    const BusCounters& bus = bus_->counters();
    status_.counter("bus_write_dropped") = bus.write_dropped;
    status_.counter("bus_times_down") = bus.times_down;
  }

  // Without a bus the plant publishes what an unattacked driver would have.
  void publish_measurements() {
    for (const CanFrame& frame : frames_) {
      const MeasurementSet* closed = assembler_.on_frame(frame);
      if (closed == nullptr) continue;
      MeasurementSet set = *closed;
      if (radio_) radio_->apply(set);
      to_message(set, measurement_);
      link_.publish("MEASUREMENT", measurement_);
    }
  }

  const Experiment& experiment_;
  CanBus* bus_;
  LcmLink& link_;
  StatusReporter status_;
  std::unique_ptr<Plant> plant_;
  FrameCodec codec_;
  MeasurementAssembler assembler_;
  std::unique_ptr<RadioChannel> radio_;
  truth_t truth_;
  attack_signal_t attack_signal_;
  measurement_set_t measurement_;
  std::vector<CanFrame> frames_;
};

int run(const ProgramOptions& options, const std::string& bus_url) {
  const Experiment experiment = options.load();
  LcmLink link(options.lcm_url);
  BusOptions bus_options;
  bus_options.may_write = true;
  bus_options.owned_url = options.owned_bus;
  StatusReporter* reporter = nullptr;
  bus_options.on_event = [&reporter](const std::string& event) {
    if (reporter != nullptr) reporter->remark(event);
  };
  const std::unique_ptr<CanBus> bus = bus_url == "none" ? nullptr : open_can_bus(bus_url, bus_options);
  PlantProcess plant(experiment, bus.get(), link);
  reporter = &plant.status();
  reporter->set_state(ProcessState::kRunning);

  EventLoop loop;
  Pacer pacer(std::max(experiment.period_s, 1e-6));
  bool is_stopped = false;
  loop.watch(pacer.file_descriptor(), [&] {
    if (pacer.acknowledge() == 0) return;
    reporter->counter("missed_deadlines") = pacer.missed();
    if (!plant.advance()) loop.stop();
  });
  // Nothing on the sensor-side bus is for the plant; reading keeps its queue short and tells its state.
  std::array<CanFrame, 64> ignored;
  if (bus) loop.watch_bus(*bus, [&] { while (bus->read(ignored) == ignored.size()) continue; });
  loop.every(0.25, [&] { reporter->publish(); });
  loop.on_stop_signal([&] {
    is_stopped = true;
    loop.stop();
  });
  reporter->publish();
  loop.run();
  reporter->set_state(is_stopped ? ProcessState::kFailed : ProcessState::kFinished);
  if (is_stopped) reporter->remark("stopped before the last step");
  reporter->publish();
  return is_stopped ? 1 : 0;
}

}  // namespace
}  // namespace holdfast

int main(int argc, char** argv) {
  CLI::App app{"Simulates the plant of a scenario: truth on PLANT_TRUTH, sensor frames and the tick on the bus."};
  app.footer("Example:\n  holdfast-plant scenarios/binary_tracking.yaml --bus socketcan:vcan0");
  holdfast::ProgramOptions options;
  std::string bus = "none";
  options.add_scenario(app);
  options.add_lcm(app);
  options.add_owned_bus(app);
  app.add_option("--bus", bus, "Sensor-side bus URL; 'none' publishes MEASUREMENT directly")->required();
  const int status = holdfast::parse_command_line(app, "holdfast-plant", argc, argv);
  if (status >= 0) return status;
  return holdfast::run_program("holdfast-plant", [&] { return holdfast::run(options, bus); });
}
