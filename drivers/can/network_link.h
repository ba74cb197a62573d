#pragma once

#include <string>

#include "drivers/file_descriptor.h"

namespace holdfast {

/// What the kernel says of a network interface now.
struct NetworkLink {
  int index = 0;  // 0: no such interface
  bool is_up = false;
  int mtu = 0;
};

/// Asks by name; any name is allowed.
NetworkLink read_network_link(const std::string& name);

/// Kind by rtnetlink (IFLA_INFO_KIND): "vcan", "vxcan", "can", ...; "" for hardware without one,
/// and for an interface that is not there.
std::string network_link_kind(const std::string& name);

/// Tells when any interface of this network namespace changed.
class LinkMonitor {
 public:
  /// Throws JobError when the kernel refuses.
  LinkMonitor();

  int file_descriptor() const { return socket_.get(); }
  /// Forgets what was told; true when there was something.
  bool take_changes();

 private:
  FileDescriptor socket_;
};

}  // namespace holdfast
