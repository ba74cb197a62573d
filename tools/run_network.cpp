#include "tools/run_network.h"

#include <array>

#include "common/errors.h"
#include "drivers/can/can_bus.h"
#include "drivers/event_loop.h"

namespace holdfast {
namespace {

// LCM 1.3.1 keeps runs apart by port only, never by group.
constexpr int kLcmPortFirst = 17667, kBusPortFirst = 43113, kPortsTried = 400;

int take_port(int first, std::vector<SocketLock>& locks) {
  for (int port = first; port < first + kPortsTried; ++port) {
    int descriptor = -1;
    if (SocketLock::try_lock("holdfast-port " + std::to_string(port), descriptor)) {
      locks.push_back(SocketLock::adopt(descriptor));
      return port;
    }
  }
  throw JobError("no free port from " + std::to_string(first) +
                 " on: are that many runs going on?");
}

std::string resolve_bus(const std::string& given, const std::string& vcan, bool has_vcan,
                        RunNetwork& network) {
  if (given != "auto") return given;
  if (has_vcan) return "socketcan:" + vcan;
  network.is_embedded_bus = true;
  return "udp:239.74.163.2:" + std::to_string(take_port(kBusPortFirst, network.locks));
}

// A run's processes must meet on its buses, and what one sends must reach the next.
void require_shared_bus(const std::string& key, const std::string& url) {
  const auto has_scheme = [&url](const char* scheme) { return url.rfind(scheme, 0) == 0; };
  if (url == "auto" || has_scheme("socketcan:") || has_scheme("udp:")) return;
  std::string reason = "is no bus";
  if (has_scheme("loop:")) reason = "lives within one process, and a live run has several";
  if (has_scheme("slcan:"))
    reason =
        "is one adapter, which one process opens: start the processes by hand (docs/scenario.md)";
  if (has_scheme("candump:") || has_scheme("candump-write:"))
    reason = "is a file, on which no process can answer another";
  throw UsageError(key + ": " + url + " " + reason +
                   "; a live run takes auto, socketcan:INTERFACE, udp:GROUP:PORT, or none for both "
                   "buses");
}

}  // namespace

RunNetwork resolve_network(const Experiment& experiment, const std::string& lcm_url) {
  RunNetwork network;
  if (experiment.has_bus()) {
    require_shared_bus("network.sensor_bus", experiment.sensor_bus);
    require_shared_bus("network.monitor_bus", experiment.monitor_bus);
  }
  network.lcm_url = lcm_url;
  if (lcm_url.empty()) {
    network.lcm_url =
        "udpm://239.255.76.67:" + std::to_string(take_port(kLcmPortFirst, network.locks)) +
        "?ttl=0";
  }
  if (!experiment.has_bus()) {
    network.sensor_bus = network.monitor_bus = "none";
    return network;
  }
  const bool has_vcan = is_virtual_can("vcan0") && is_virtual_can("vcan1");
  network.sensor_bus = resolve_bus(experiment.sensor_bus, "vcan0", has_vcan, network);
  network.monitor_bus = resolve_bus(experiment.monitor_bus, "vcan1", has_vcan, network);
  for (const std::string& url : {network.sensor_bus, network.monitor_bus}) {
    network.locks.emplace_back("holdfast-run " + url, "another run uses " + url);
  }
  return network;
}

void require_quiet_bus(const std::string& url, double seconds) {
  const std::unique_ptr<CanBus> bus = open_can_bus(url, {});
  EventLoop loop;
  std::array<CanFrame, 16> frames;
  bool is_quiet = true;
  loop.watch_bus(*bus, [&] {
    if (bus->read(frames) == 0) return;
    is_quiet = false;
    loop.stop();
  });
  loop.after(seconds, [&] { loop.stop(); });
  loop.run();
  if (!is_quiet) {
    throw JobError("foreign frames arrive on " + url +
                   " before the run has begun; stop their sender, or name another bus in the "
                   "scenario (network.sensor_bus, network.monitor_bus)");
  }
}

}  // namespace holdfast
