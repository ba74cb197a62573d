#include "drivers/can/can_bus.h"

#include "common/errors.h"
#include "drivers/can/candump_bus.h"
#include "drivers/can/loop_bus.h"
#include "drivers/can/network_link.h"
#include "drivers/can/slcan_bus.h"
#include "drivers/can/socketcan_bus.h"
#include "drivers/can/udp_bus.h"

namespace holdfast {

std::unique_ptr<CanBus> open_can_bus(const std::string& url, const BusOptions& options) {
  const std::size_t colon = url.find(':');
  const std::string kind = url.substr(0, colon);
  const std::string rest = colon == std::string::npos ? "" : url.substr(colon + 1);
  if (colon == std::string::npos || (rest.empty() && kind != "loop")) {
    throw UsageError("'" + url + "' is no bus: expected socketcan:INTERFACE, udp:GROUP:PORT, " +
                     "slcan:DEVICE, loop:NAME, candump:FILE or candump-write:FILE");
  }
  if (kind == "socketcan") {
    constexpr std::size_t kInterfaceNameMax = 15;
    if (rest.size() > kInterfaceNameMax || rest.find_first_of(" /:") != std::string::npos) {
      throw UsageError(url + ": '" + rest + "' cannot be the name of an interface");
    }
    return std::make_unique<SocketCanBus>(rest, options);
  }
  if (kind == "slcan") return std::make_unique<SlcanBus>(url, options);
  if (kind == "udp") return std::make_unique<UdpBus>(url, options);
  if (kind == "loop") return std::make_unique<LoopBus>(std::make_shared<LoopMedium>(), options);
  if (kind == "candump") {
    if (options.may_write) throw UsageError(url + ": is only read; write to candump-write:FILE");
    return std::make_unique<CandumpReader>(rest);
  }
  if (kind == "candump-write") return std::make_unique<CandumpWriter>(rest, options);
  throw UsageError("'" + url + "' is no bus: there is no kind '" + kind + "'; the kinds are " +
                   "socketcan, udp, slcan, loop, candump and candump-write");
}

std::string canonical_bus_url(const std::string& url) {
  if (url.rfind("udp:", 0) != 0) return url;
  try {
    return canonical_udp_url(url);
  } catch (const UsageError&) {
    return url;
  }
}

bool is_virtual_can(const std::string& interface_name) {
  const std::string kind = network_link_kind(interface_name);
  return kind == "vcan" || kind == "vxcan";
}

}  // namespace holdfast
