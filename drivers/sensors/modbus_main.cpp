#include <memory>

#include "common/lcm_link.h"
#include "drivers/can/can_bus.h"
#include "tools/live_modbus.h"
#include "tools/program_options.h"

namespace holdfast {
namespace {

struct ModbusOptions : ProgramOptions {
  LiveModbus live;
  std::string bus;
};

int run(const ModbusOptions& options) {
  const Experiment experiment = options.load();
  LcmLink link(options.lcm_url);
  BusOptions bus_options;
  bus_options.may_write = options.live.unit == 0;
  bus_options.wants_frames = options.live.unit != 0;
  bus_options.owned_urls = options.owned_buses;
  const std::unique_ptr<CanBus> bus = open_can_bus(options.bus, bus_options);
  return run_modbus(experiment, options.live, *bus, link);
}

}  // namespace
}  // namespace holdfast

int main(int argc, char** argv) {
  CLI::App app{
      "Asks the Modbus RTU units of a scenario for their inputs, once in each step, and tells what "
      "they say on a CAN bus."};
  app.footer(
      "Examples:\n"
      "  holdfast-modbus S.yaml --line '/dev/ttyUSB0@9600?parity=none' --bus socketcan:vcan0\n"
      "  holdfast-modbus S.yaml --serve 3 --line /dev/pts/7 --bus socketcan:vcan0\n"
      "Exit status: 0 after the last step (--serve: when stopped), 1 stopped before it, no unit "
      "ever "
      "answered,\nframes were lost or the line is not there, 2 wrong use.");
  holdfast::ModbusOptions options;
  options.add_scenario(app);
  options.add_lcm(app);
  options.add_owned_bus(app);
  app.add_option("--line", options.live.line,
                 "Serial line: DEVICE[@BAUD][?parity=even|odd|none][&stop=1|2]; default 19200 8E1")
      ->required();
  app.add_option("--bus", options.bus, "Bus that frames go to; with --serve come from")->required();
  CLI::Option* serve =
      app.add_option("--serve", options.live.unit,
                     "Be this unit: answer on the line what a simulated plant tells on the bus")
          ->check(CLI::Range(1, 247));
  app.add_flag("--in-step", options.live.is_in_step,
               "With --serve: the nth round of requests gets step n, not the latest one")
      ->needs(serve);
  return holdfast::run_command_line(app, "holdfast-modbus", argc, argv,
                                    [&] { return holdfast::run(options); });
}
