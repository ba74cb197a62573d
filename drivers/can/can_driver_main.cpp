#include <algorithm>

#include "common/pacer.h"
#include "drivers/can/can_bus.h"
#include "drivers/event_loop.h"
#include "tools/driver_process.h"
#include "tools/live_look.h"
#include "tools/program_options.h"

namespace holdfast {
namespace {

int run(const ProgramOptions& options, const std::string& bus_url) {
  const Experiment experiment = options.load();
  LcmLink link(options.lcm_url);
  DriverProcess driver(experiment, link, bus_url);
  BusOptions bus_options;
  const bool wants_to_write =
      !experiment.commands.empty() || experiment.layout.sensors.have_way_back();
  // A recording cannot be told anything any more.
  const bool is_recording = bus_url.starts_with("candump:");
  bus_options.may_write = wants_to_write && !is_recording;
  if (is_recording) driver.set_read_only();
  if (wants_to_write && is_recording)
    driver.status().remark("a recording is only read: nothing is sent to sensors or plant");
  if (is_recording && !experiment.assembler.closed_by_tick)
    driver.close_by_stamps(static_cast<std::int64_t>(std::max(experiment.period_s, 1e-6) * 1e9));
  bus_options.owned_urls = options.owned_buses;
  bus_options.on_event = [&driver](const std::string& event) { driver.status().remark(event); };
  const std::unique_ptr<CanBus> bus = open_can_bus(bus_url, bus_options);

  EventLoop loop;
  bool is_stopped = false;
  std::unique_ptr<Pacer> clock;
  // The driver's own clock starts with the first frame: nobody knows how long the sensors take.
  const auto start_clock = [&] {
    clock = std::make_unique<Pacer>(std::max(experiment.period_s, 1e-6));
    loop.watch(clock->file_descriptor(), [&] {
      for (std::int64_t due = clock->acknowledge(); due > 0 && !driver.is_finished(); --due)
        driver.close_step(*bus);
      if (driver.is_finished()) loop.stop();
    });
  };
  loop.watch_bus(*bus, [&] {
    driver.on_readable(*bus);
    const bool has_own_clock = !experiment.assembler.closed_by_tick && !is_recording;
    if (has_own_clock && !clock && driver.has_frames()) start_clock();
    // A recorded bus may end before the run that it holds.
    if (driver.is_finished() || bus->at_end()) loop.stop();
  });
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
  if (!is_complete)
    driver.status().remark(is_stopped ? "stopped before the last step"
                                      : bus_url + " ended before the last step");
  driver.publish_status(*bus);
  return is_complete ? 0 : 1;
}

struct DriverOptions : ProgramOptions {
  std::string bus, dbc;
  double look_s = 0.0;
};

}  // namespace
}  // namespace holdfast

int main(int argc, char** argv) {
  CLI::App app{
      "Reads the monitor-side bus and publishes the measurement set of each step on MEASUREMENT."};
  app.footer(
      "Examples:\n  holdfast-can-driver scenarios/binary_tracking.yaml --bus socketcan:vcan1\n"
      "  holdfast-can-driver --bus socketcan:can0 --look 10 --dbc vendor.dbc   # what is there?");
  holdfast::DriverOptions options;
  options.add_scenario(app)->required(false);
  options.add_lcm(app);
  options.add_owned_bus(app);
  app.add_option("--look", options.look_s,
                 "Instead of a scenario: listen for so many seconds and say what arrives")
      ->check(CLI::Range(0.1, 1e6));
  app.add_option("--dbc", options.dbc, "With --look: a DBC file that names what arrives");
  app.add_option(
         "--bus", options.bus,
         "Monitor-side bus URL (read-only, unless there are commands, or nodes to start or guard)")
      ->required();
  return holdfast::run_command_line(app, "holdfast-can-driver", argc, argv, [&] {
    if (options.look_s > 0.0)
      return holdfast::look_at_bus(options.bus, options.dbc, options.look_s);
    if (options.scenario.empty()) throw holdfast::UsageError("a scenario is needed, or --look");
    return holdfast::run(options, options.bus);
  });
}
