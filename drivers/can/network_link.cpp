#include "drivers/can/network_link.h"

#include <linux/rtnetlink.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>

#include "common/errors.h"
#include "drivers/can/datagram_batch.h"

namespace holdfast {
namespace {

using Bytes = std::span<const std::uint8_t>;

/// Walks attributes; calls visit(type, payload) for each. Stops at the first that does not fit.
template <class Visit>
void for_each_attribute(Bytes bytes, Visit visit) {
  while (bytes.size() >= sizeof(rtattr)) {
    rtattr attribute{};
    std::memcpy(&attribute, bytes.data(), sizeof attribute);
    if (attribute.rta_len < sizeof attribute || attribute.rta_len > bytes.size()) return;
    visit(attribute.rta_type & NLA_TYPE_MASK,
          bytes.first(attribute.rta_len).subspan(sizeof attribute));
    const std::size_t step = (attribute.rta_len + 3U) & ~std::size_t{3};
    if (step >= bytes.size()) return;
    bytes = bytes.subspan(step);
  }
}

std::string kind_in_answer(Bytes answer) {
  nlmsghdr header{};
  if (answer.size() < sizeof header + sizeof(ifinfomsg)) return "";
  std::memcpy(&header, answer.data(), sizeof header);
  if (header.nlmsg_type != RTM_NEWLINK) return "";
  std::string kind;
  for_each_attribute(answer.subspan(sizeof header + sizeof(ifinfomsg)), [&](int type, Bytes info) {
    if (type != IFLA_LINKINFO) return;
    for_each_attribute(info, [&](int info_type, Bytes text) {
      if (info_type != IFLA_INFO_KIND) return;
      kind.assign(text.begin(), text.end());
      kind.resize(std::strlen(kind.c_str()));  // the kernel counts the final NUL
    });
  });
  return kind;
}

}  // namespace

NetworkLink read_network_link(const std::string& name) {
  NetworkLink link;
  ifreq request{};
  if (name.empty() || name.size() >= sizeof request.ifr_name) return link;
  const FileDescriptor any_socket(socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE));
  name.copy(request.ifr_name, name.size());
  if (ioctl(any_socket.get(), SIOCGIFINDEX, &request) != 0) return link;
  link.index = request.ifr_ifindex;
  if (ioctl(any_socket.get(), SIOCGIFFLAGS, &request) == 0) {
    link.is_up = (request.ifr_flags & IFF_UP) != 0;
  }
  if (ioctl(any_socket.get(), SIOCGIFMTU, &request) == 0) link.mtu = request.ifr_mtu;
  return link;
}

std::string network_link_kind(const std::string& name) {
  const int index = read_network_link(name).index;
  if (index == 0) return "";
  const FileDescriptor netlink(socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE));
  struct {
    nlmsghdr header;
    ifinfomsg link;
  } request{};
  request.header.nlmsg_len = sizeof request;
  request.header.nlmsg_type = RTM_GETLINK;
  request.header.nlmsg_flags = NLM_F_REQUEST;
  request.link.ifi_index = index;
  if (send(netlink.get(), &request, sizeof request, 0) < 0) return "";
  std::array<std::uint8_t, 32768> answer;
  const ssize_t size = recv(netlink.get(), answer.data(), answer.size(), 0);
  return size <= 0 ? "" : kind_in_answer(Bytes(answer).first(static_cast<std::size_t>(size)));
}

LinkMonitor::LinkMonitor()
    : socket_(socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, NETLINK_ROUTE)) {
  sockaddr_nl address{};
  address.nl_family = AF_NETLINK;
  address.nl_groups = RTMGRP_LINK;
  void* const place = &address;
  if (bind(socket_.get(), static_cast<sockaddr*>(place), sizeof address) != 0) {
    throw JobError(system_problem("cannot watch network interfaces", errno));
  }
}

bool LinkMonitor::take_changes() {
  bool had_some = false;
  std::array<std::uint8_t, 256> part;  // what does not fit is cut: only the arrival counts
  for (;;) {
    const ssize_t size = recv(socket_.get(), part.data(), part.size(), 0);
    if (size >= 0 || errno == ENOBUFS) {
      had_some = true;
    } else if (errno != EINTR) {
      return had_some;
    }
  }
}

}  // namespace holdfast
