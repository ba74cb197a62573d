#include <iostream>

#include "tools/live_attack.h"
#include "tools/offline_attack.h"
#include "tools/program_options.h"

namespace holdfast {
namespace {

struct AttackerOptions : ProgramOptions {
  LiveAttack attack;
  OfflineAttack offline;

  LiveAttack live() const {
    LiveAttack all = attack;
    all.lcm_url = lcm_url;
    all.owned_buses = owned_buses;
    return all;
  }
};

int run(const AttackerOptions& options) {
  if (options.offline.is_wanted()) {
    if (!options.attack.from.empty() || !options.attack.to.empty() ||
        !options.attack.control.empty())
      throw UsageError("give either buses (--from, --to, --control) or recordings (--in, --out)");
    OfflineAttack files = options.offline;
    files.is_dry = options.attack.is_dry;
    std::cout << attack_offline(options.load(), files);
    return 0;
  }
  return attack_live(options.load(), options.live());
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
  app.add_option("--from", options.attack.from,
                 "Sensor-side bus URL (read-only, unless commands go there)");
  app.add_option("--to", options.attack.to, "Monitor-side bus URL");
  app.add_flag("--no-record", options.attack.no_record,
               "Neither truth nor status on LCM: forward only");
  app.add_flag("--ignore-losses", options.attack.ignore_losses,
               "Status 0 even when frames were lost: who reads the record tells of them");
  app.add_flag("--dry-run", options.attack.is_dry,
               "Forward all frames as they are; say what would be done to them on ATTACK_LABEL, or "
               "in --truth");
  app.add_option("--control", options.attack.control,
                 "Path of a local socket, made here, on which rules can be changed while it runs: "
                 "see holdfast-control");
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
