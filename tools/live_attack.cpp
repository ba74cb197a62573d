#include "tools/live_attack.h"

#include <algorithm>
#include <iostream>
#include <memory>
#include <optional>

#include "drivers/can/can_bus.h"
#include "drivers/control_socket.h"
#include "drivers/event_loop.h"
#include "drivers/socket_lock.h"
#include "tools/attacker_process.h"
#include "tools/rule_book.h"

namespace holdfast {

int attack_live(const Experiment& experiment, const LiveAttack& options) {
  if (options.from.empty() || options.to.empty())
    throw UsageError("--from and --to are needed: URLs of the sensor-side and monitor-side bus");
  const std::string from_url = canonical_bus_url(options.from),
                    to_url = canonical_bus_url(options.to);
  if (from_url == to_url)
    throw UsageError("--from and --to are the same bus: frames would run in circles");
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
  AttackerProcess attacker(experiment, options.to, link ? &*link : nullptr,
                           {options.is_dry, !options.control.empty()});
  BusOptions bus_options;
  bus_options.owned_urls = options.owned_buses;
  bus_options.wants_receive_times = !options.no_record;
  bus_options.on_event = [&attacker](const std::string& event) { attacker.remark(event); };
  bus_options.may_write = attacker.has_way_back();
  const std::unique_ptr<CanBus> from = open_can_bus(options.from, bus_options);
  bus_options.may_write = true;
  bus_options.wants_frames = attacker.has_way_back();
  const std::unique_ptr<CanBus> to = open_can_bus(options.to, bus_options);

  EventLoop loop;
  std::optional<RuleBook> rules;
  std::optional<ControlSocket> control;
  if (!options.control.empty()) {
    rules.emplace(experiment, attacker.core());
    control.emplace(
        loop, options.control,
        [&](const std::string& request, double& watch_s) {
          const std::int64_t before = attacker.core().generation();
          std::string answer = rules->answer(request, watch_s);
          const std::int64_t now = attacker.core().generation();
          if (now != before)
            attacker.remark("rules were changed: generation " + std::to_string(now));
          return answer;
        },
        [&](const std::string& why) {
          if (rules->pause_all()) attacker.remark(why + ": all rules are paused, frames pass");
        });
  }
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

}  // namespace holdfast
