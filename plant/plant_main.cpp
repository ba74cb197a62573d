#include <algorithm>

#include "common/pacer.h"
#include "drivers/can/can_bus.h"
#include "drivers/event_loop.h"
#include "tools/plant_process.h"
#include "tools/program_options.h"

namespace holdfast {
namespace {

int run(const ProgramOptions& options, const std::string& bus_url) {
  const Experiment experiment = options.load();
  LcmLink link(options.lcm_url);
  BusOptions bus_options;
  bus_options.may_write = true;
  bus_options.owned_urls = options.owned_buses;
  StatusReporter* reporter = nullptr;
  bus_options.on_event = [&reporter](const std::string& event) {
    if (reporter != nullptr) reporter->remark(event);
  };
  const std::unique_ptr<CanBus> bus =
      bus_url == "none" ? nullptr : open_can_bus(bus_url, bus_options);
  PlantProcess plant(experiment, bus.get(), bus_url, link);
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
  if (bus) loop.watch_bus(*bus, [&] { plant.on_readable(); });
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
  CLI::App app{
      "Simulates the plant of a scenario: truth on PLANT_TRUTH, sensor frames and the tick on the "
      "bus."};
  app.footer("Example:\n  holdfast-plant scenarios/binary_tracking.yaml --bus socketcan:vcan0");
  holdfast::ProgramOptions options;
  std::string bus = "none";
  options.add_scenario(app);
  options.add_lcm(app);
  options.add_owned_bus(app);
  app.add_option("--bus", bus, "Sensor-side bus URL; 'none' publishes MEASUREMENT directly")
      ->required();
  return holdfast::run_command_line(app, "holdfast-plant", argc, argv,
                                    [&] { return holdfast::run(options, bus); });
}
