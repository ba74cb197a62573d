#pragma once

#include <netinet/in.h>

#include <string>

#include "drivers/can/can_bus.h"
#include "drivers/can/datagram_batch.h"
#include "drivers/file_descriptor.h"

namespace holdfast {

/// The URL with group and port in their usual spelling. Throws UsageError for another form.
std::string canonical_udp_url(const std::string& url);

/// A bus of UDP multicast datagrams, each one frame in the format of python-can's udp_multicast.
///
/// Stays on the loopback interface, both ways, whatever the routes say; other programs must use
/// loopback too (`ip route add 224.0.0.0/4 dev lo` sends python-can there). Only for a URL that
/// options.owned_urls names, the routing table decides and one hop is allowed.
///
/// Frames of one sender keep their order. Datagrams that are no frames are counted in `refused`.
class UdpBus : public CanBus {
 public:
  /// url: "udp:GROUP:PORT". Throws UsageError for another form, an address that is not multicast,
  /// or a group outside 239.0.0.0/8 that is not owned; JobError when the sockets cannot be opened.
  UdpBus(const std::string& url, const BusOptions& options);

  int file_descriptor() const override { return receiver_.get(); }
  std::size_t read(std::span<CanFrame> frames) override;
  /// Throws std::logic_error when the bus was opened read-only.
  std::size_t write(std::span<const CanFrame> frames) override;
  const BusCounters& counters() override;

 private:
  void open_receiver(const ip_mreqn& membership);
  void open_sender(const ip_mreqn& membership);
  bool is_own(const sockaddr_in& sender) const;
  bool take(std::size_t i, CanFrame& frame);
  std::size_t fill(std::span<const CanFrame> frames);
  std::size_t send_filled(std::size_t num, WriteDeadline& deadline);

  std::string url_;
  BusOptions options_;
  sockaddr_in group_{};
  sockaddr_in own_address_{};  // of the sending socket; port 0 when read-only
  FileDescriptor receiver_, sender_;
  int granted_bytes_ = 0;
  ReceiveBatch received_;
  SendBatch sending_;
  DropCounter drops_;
  BusCounters counters_;
};

}  // namespace holdfast
