#pragma once

#include <string>
#include <vector>

#include "drivers/socket_lock.h"
#include "tools/experiment.h"

namespace holdfast {

/// Where a run's processes meet: LCM URL and bus URLs, with the locks that keep them its own.
struct RunNetwork {
  std::string lcm_url;
  std::string sensor_bus, monitor_bus;  // URLs, or both "none"
  bool is_embedded_bus = false;         // UDP because this kernel has no virtual CAN
  std::vector<SocketLock> locks;
};

/// Resolves "auto": socketcan:vcan0 and vcan1 where both are there and up, else two UDP buses on
/// free ports of loopback. Takes a free LCM port unless lcm_url is given. Throws
/// UsageError for a bus that processes cannot share (loop:, candump:), and JobError when a bus is
/// taken by another run.
RunNetwork resolve_network(const Experiment& experiment, const std::string& lcm_url);

/// Listens for `seconds`; throws JobError when frames already arrive on the bus.
void require_quiet_bus(const std::string& url, double seconds);

}  // namespace holdfast
