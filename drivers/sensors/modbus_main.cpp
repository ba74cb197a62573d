#include <algorithm>
#include <memory>

#include "common/pacer.h"
#include "drivers/can/can_bus.h"
#include "drivers/event_loop.h"
#include "tools/modbus_process.h"
#include "tools/program_options.h"

namespace holdfast {
namespace {

struct ModbusOptions : ProgramOptions {
  std::string line, bus;
  int unit = 0;
  bool is_in_step = false;
};

// Ends with 0 after the last step; stopped before it, with 1.
int ask_units(const ModbusOptions& options, const Experiment& experiment, CanBus& bus,
              LcmLink& link) {
  ModbusGateway gateway(experiment, options.line, bus, link);
  EventLoop loop;
  Pacer pacer(std::max(experiment.period_s, 1e-3));
  bool is_finished = false;
  loop.watch(pacer.file_descriptor(), [&] {
    if (pacer.acknowledge() == 0) return;
    gateway.status().counter("missed_deadlines") = pacer.missed();
    is_finished = !gateway.take_step();
    if (is_finished) loop.stop();
  });
  loop.every(0.25, [&] { gateway.status().publish(); });
  loop.on_stop_signal([&] { loop.stop(); });
  gateway.status().set_state(ProcessState::kReady);
  gateway.status().publish();
  loop.run();
  gateway.status().set_state(is_finished ? ProcessState::kFinished : ProcessState::kFailed);
  if (!is_finished) gateway.status().remark("stopped before the last step");
  gateway.status().publish();
  return is_finished ? 0 : 1;
}

int serve_unit(const ModbusOptions& options, const Experiment& experiment, CanBus& bus,
               LcmLink& link) {
  ModbusUnitProcess unit(experiment, options.line, options.unit, options.is_in_step, bus, link);
  EventLoop loop;
  loop.watch(unit.line_descriptor(), [&] { unit.on_line(); });
  loop.watch_bus(bus, [&] { unit.on_bus(); });
  loop.every(0.25, [&] { unit.publish_status(); });
  loop.on_stop_signal([&] { loop.stop(); });
  unit.status().set_state(ProcessState::kReady);
  unit.publish_status();
  loop.run();
  unit.status().set_state(ProcessState::kFinished);
  unit.publish_status();
  return 0;
}

int run(const ModbusOptions& options) {
  const Experiment experiment = options.load();
  LcmLink link(options.lcm_url);
  BusOptions bus_options;
  bus_options.may_write = options.unit == 0;
  bus_options.wants_frames = options.unit != 0;
  bus_options.owned_urls = options.owned_buses;
  const std::unique_ptr<CanBus> bus = open_can_bus(options.bus, bus_options);
  return options.unit == 0 ? ask_units(options, experiment, *bus, link)
                           : serve_unit(options, experiment, *bus, link);
}

}  // namespace
}  // namespace holdfast

int main(int argc, char** argv) {
  CLI::App app{
      "Asks the Modbus RTU units of a scenario for their inputs, once in each step, and tells what "
      "they say on a CAN bus."};
  app.footer(
      "Examples:\n"
      "  holdfast-modbus scenario.yaml --line /dev/ttyUSB0@9600?parity=none --bus socketcan:vcan0\n"
      "  holdfast-modbus scenario.yaml --serve 3 --line /dev/pts/7 --bus socketcan:vcan0");
  holdfast::ModbusOptions options;
  options.add_scenario(app);
  options.add_lcm(app);
  options.add_owned_bus(app);
  app.add_option("--line", options.line,
                 "Serial line: DEVICE[@BAUD][?parity=even|odd|none][&stop=1|2]; default 19200 8E1")
      ->required();
  app.add_option("--bus", options.bus, "Bus that frames go to; with --serve come from")->required();
  CLI::Option* serve =
      app.add_option("--serve", options.unit,
                     "Be this unit: answer on the line what a simulated plant tells on the bus")
          ->check(CLI::Range(1, 247));
  app.add_flag("--in-step", options.is_in_step,
               "With --serve: the nth round of requests gets step n, not the latest one")
      ->needs(serve);
  return holdfast::run_command_line(app, "holdfast-modbus", argc, argv,
                                    [&] { return holdfast::run(options); });
}
