#include <algorithm>
#include <iostream>
#include <optional>

#include "drivers/can/can_bus.h"
#include "drivers/event_loop.h"
#include "drivers/socket_lock.h"
#include "tools/attacker_process.h"
#include "tools/offline_attack.h"
#include "tools/program_options.h"

namespace holdfast {
namespace {

struct AttackerOptions : ProgramOptions {
  std::string from, to;
  bool no_record = false, ignore_losses = false;
  OfflineAttack offline;
};

int run(const AttackerOptions& options) {
  if (options.offline.is_wanted()) {
    if (!options.from.empty() || !options.to.empty())
      throw UsageError("give either buses (--from, --to) or recordings (--in, --out)");
    std::cout << attack_offline(options.load(), options.offline);
    return 0;
  }
  if (options.from.empty() || options.to.empty())
    throw UsageError("--from and --to are needed: URLs of the sensor-side and monitor-side bus");
  const std::string from_url = canonical_bus_url(options.from),
                    to_url = canonical_bus_url(options.to);
  if (from_url == to_url)
    throw UsageError("--from and --to are the same bus: frames would run in circles");
  const Experiment experiment = options.load();
  // One proxy writes to a bus, and none stands between the same two the other way round: two would
  // hand each other's frames back and forth.
  const auto& [first, second] = std::minmax(from_url, to_url);
  const SocketLock pair_lock(
      "holdfast-proxy between " + first + " " + second,
      "another holdfast-attacker already runs between " + from_url + " and " + to_url);
  const SocketLock write_lock("holdfast-proxy to " + to_url,
                              "another holdfast-attacker already writes to " + to_url);
  std::optional<LcmLink> link;
  if (!options.no_record) link.emplace(options.lcm_url);
  AttackerProcess attacker(experiment, options.to, link ? &*link : nullptr);
  BusOptions bus_options;
  bus_options.owned_urls = options.owned_buses;
  bus_options.wants_receive_times = !options.no_record;
  bus_options.on_event = [&attacker](const std::string& event) { attacker.remark(event); };
  bus_options.may_write = attacker.has_commands();
  const std::unique_ptr<CanBus> from = open_can_bus(options.from, bus_options);
  bus_options.may_write = true;
  bus_options.wants_frames = attacker.has_commands();
  const std::unique_ptr<CanBus> to = open_can_bus(options.to, bus_options);

  EventLoop loop;
  bool is_stopped = false;
  loop.watch_bus(*from, [&] {
    attacker.on_readable(*from, *to);
    if (attacker.is_finished()) loop.stop();
  });
  loop.watch_bus(*to, [&] { attacker.on_monitor_readable(*from, *to); });
  loop.every(0.25, [&] { attacker.publish_status(*from, *to); });
  loop.on_stop_signal([&] {
    is_stopped = true;
    loop.stop();
  });
  attacker.set_state(ProcessState::kReady);
  attacker.publish_status(*from, *to);
  std::cout << "ready" << std::endl;
  loop.run();
  attacker.flush_record();
  attacker.set_state(is_stopped ? ProcessState::kFailed : ProcessState::kFinished);
  attacker.publish_status(*from, *to);
  return is_stopped ? 1 : options.ignore_losses ? 0 : attacker.end_status(*from, *to);
}

}  // namespace
}  // namespace holdfast

int main(int argc, char** argv) {
  CLI::App app{
      "The man in the middle: forwards frames from the sensor-side to the monitor-side bus and "
      "applies the scenario's attacks."};
  app.footer(
      "Example:\n  holdfast-attacker scenarios/binary_tracking.yaml --from socketcan:vcan0 --to "
      "socketcan:vcan1");
  holdfast::AttackerOptions options;
  options.add_scenario(app);
  options.add_lcm(app);
  options.add_owned_bus(app);
  app.add_option("--from", options.from,
                 "Sensor-side bus URL (read-only, unless commands go there)");
  app.add_option("--to", options.to, "Monitor-side bus URL");
  app.add_flag("--no-record", options.no_record, "Neither truth nor status on LCM: forward only");
  app.add_flag("--ignore-losses", options.ignore_losses,
               "Status 0 even when frames were lost: who reads the record tells of them");
  app.add_option("--in", options.offline.in,
                 "Instead of buses: a recording of the sensor-side bus, as candump -L writes it");
  app.add_option("--out", options.offline.out,
                 "New recording: what the monitor-side bus would see");
  app.add_option("--truth", options.offline.truth,
                 "New file, JSON lines: what was done, with --in");
  app.add_option("--commands", options.offline.commands,
                 "New recording: forged commands to the plant, with --in");
  return holdfast::run_command_line(app, "holdfast-attacker", argc, argv,
                                    [&] { return holdfast::run(options); });
}
