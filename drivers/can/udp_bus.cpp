#include "drivers/can/udp_bus.h"

#include <arpa/inet.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <stdexcept>

#include "common/clock.h"
#include "common/errors.h"
#include "drivers/can/udp_frame.h"

namespace holdfast {
namespace {

sockaddr_in parse_group(const std::string& url) {
  const UsageError form_problem(url + ": expected udp:GROUP:PORT, as in udp:239.74.163.2:43113");
  const std::size_t first = url.find(':'), last = url.rfind(':');
  if (first == last || url.compare(0, first, "udp") != 0) throw form_problem;
  sockaddr_in group{};
  group.sin_family = AF_INET;
  if (inet_pton(AF_INET, url.substr(first + 1, last - first - 1).c_str(), &group.sin_addr) != 1) {
    throw form_problem;
  }
  std::uint16_t port = 0;
  const char* const end = url.data() + url.size();
  const auto parsed = std::from_chars(url.data() + last + 1, end, port);
  if (parsed.ec != std::errc{} || parsed.ptr != end || port == 0) throw form_problem;
  group.sin_port = htons(port);
  return group;
}

void check_group(const std::string& url, const sockaddr_in& group, bool is_owned) {
  const std::uint32_t address = ntohl(group.sin_addr.s_addr);
  if (!IN_MULTICAST(address)) {
    throw UsageError(url + ": not a multicast address (224.0.0.0 to 239.255.255.255)");
  }
  if ((address >> 24) != 239 && !is_owned) {
    throw UsageError(url +
                     ": outside 239.0.0.0/8, where other programs may listen; using it needs " +
                     "--i-own-this-bus " + url);
  }
}

const sockaddr* generic(const sockaddr_in& address) {
  const void* const place = &address;
  return static_cast<const sockaddr*>(place);
}

template <class Value>
void set_option(int fd, int level, int name, const Value& value, const std::string& what) {
  if (setsockopt(fd, level, name, &value, sizeof value) != 0) {
    throw JobError(system_problem(what, errno));
  }
}

FileDescriptor open_udp_socket(const std::string& url) {
  FileDescriptor fd(socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!fd.is_open()) throw JobError(system_problem(url + ": no socket", errno));
  return fd;
}

}  // namespace

std::string canonical_udp_url(const std::string& url) {
  const sockaddr_in group = parse_group(url);
  char text[INET_ADDRSTRLEN] = {};
  inet_ntop(AF_INET, &group.sin_addr, text, sizeof text);
  return std::string("udp:") + text + ":" + std::to_string(ntohs(group.sin_port));
}

UdpBus::UdpBus(const std::string& url, const BusOptions& options)
    : url_(url),
      options_(options),
      group_(parse_group(url)),
      received_(kUdpFrameBytesMax),
      sending_(kUdpFrameBytesMax) {
  const bool is_owned = options_.owns(url);
  check_group(url, group_, is_owned);
  ip_mreqn membership{};
  membership.imr_multiaddr = group_.sin_addr;
  membership.imr_address.s_addr = htonl(is_owned ? INADDR_ANY : INADDR_LOOPBACK);
  open_receiver(membership);
  if (options_.may_write) open_sender(membership);
}

void UdpBus::open_receiver(const ip_mreqn& membership) {
  receiver_ = open_udp_socket(url_);
  const int fd = receiver_.get();
  granted_bytes_ = prepare_receiving(fd, options_.receive_buffer_bytes);
  set_option(fd, SOL_SOCKET, SO_REUSEADDR, int{1}, url_ + ": address reuse");
  // Else datagrams of the group would also come in by interfaces that other programs joined on.
  set_option(fd, IPPROTO_IP, IP_MULTICAST_ALL, int{0}, url_ + ": own memberships only");
  if (bind(fd, generic(group_), sizeof group_) != 0) {
    throw JobError(system_problem(url_ + ": cannot be bound", errno));
  }
  set_option(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, membership,
             url_ + ": cannot join the group (is the loopback interface up?)");
}

void UdpBus::open_sender(const ip_mreqn& membership) {
  sender_ = open_udp_socket(url_);
  const int fd = sender_.get();
  const bool is_local = membership.imr_address.s_addr != htonl(INADDR_ANY);
  if (is_local) {
    set_option(fd, IPPROTO_IP, IP_MULTICAST_IF, membership, url_ + ": sending by loopback");
    // A source of our own choice keeps the sender's address local where lo has several.
    sockaddr_in source{};
    source.sin_family = AF_INET;
    source.sin_addr = membership.imr_address;
    if (bind(fd, generic(source), sizeof source) != 0) {
      throw JobError(system_problem(url_ + ": cannot be bound to loopback", errno));
    }
  }
  set_option(fd, IPPROTO_IP, IP_MULTICAST_TTL, int{is_local ? 0 : 1}, url_ + ": hop limit");
  set_option(fd, IPPROTO_IP, IP_MULTICAST_LOOP, int{1}, url_ + ": local delivery");
  if (connect(fd, generic(group_), sizeof group_) != 0) {
    throw JobError(system_problem(url_ + ": no way to the group", errno));
  }
  socklen_t size = sizeof own_address_;
  void* const place = &own_address_;
  if (getsockname(fd, static_cast<sockaddr*>(place), &size) != 0) {
    throw JobError(system_problem(url_ + ": own address", errno));
  }
}

bool UdpBus::is_own(const sockaddr_in& sender) const {
  return sender.sin_port == own_address_.sin_port &&
         sender.sin_addr.s_addr == own_address_.sin_addr.s_addr;
}

std::size_t UdpBus::read(std::span<CanFrame> frames) {
  std::size_t num_read = 0;
  while (num_read < frames.size()) {
    const std::size_t wanted = std::min(frames.size() - num_read, kBatchMax);
    const int result = received_.receive(receiver_.get(), wanted);
    if (result <= 0) break;
    const auto num_received = static_cast<std::size_t>(result);
    for (std::size_t i = 0; i < num_received; ++i) {
      if (take(i, frames[num_read])) ++num_read;
    }
    if (num_received < wanted) break;
  }
  counters_.read += static_cast<std::int64_t>(num_read);
  return num_read;
}

bool UdpBus::take(std::size_t i, CanFrame& frame) {
  drops_.note(received_.kernel_drops());
  if (is_own(received_.sender(i))) return false;
  const auto read_frame = received_.is_cut(i) ? std::nullopt : unpack_udp_frame(received_.bytes(i));
  if (!read_frame) {
    ++counters_.refused;
    return false;
  }
  if (read_frame->has(CanFrame::kError)) {
    ++counters_.error_frames;
    return false;
  }
  frame = *read_frame;
  frame.receive_time_ns = received_.receive_time_ns(i);
  return true;
}

std::size_t UdpBus::write(std::span<const CanFrame> frames) {
  if (!options_.may_write) throw std::logic_error(url_ + " was opened read-only");
  WriteDeadline deadline(options_.write_timeout_s);
  std::size_t num_written = 0;
  while (!frames.empty()) {
    const auto part = frames.first(std::min(frames.size(), kBatchMax));
    num_written += send_filled(fill(part), deadline);
    frames = frames.subspan(part.size());
  }
  counters_.written += static_cast<std::int64_t>(num_written);
  return num_written;
}

std::size_t UdpBus::fill(std::span<const CanFrame> frames) {
  const double timestamp_s = static_cast<double>(wall_utime()) * 1e-6;
  std::size_t num_filled = 0;
  for (const CanFrame& frame : frames) {
    const std::size_t size = pack_udp_frame(frame, timestamp_s, sending_.slot(num_filled));
    if (size == 0) {
      ++counters_.write_dropped;
    } else {
      sending_.set_size(num_filled++, size);
    }
  }
  return num_filled;
}

std::size_t UdpBus::send_filled(std::size_t num, WriteDeadline& deadline) {
  std::size_t done = 0;
  while (done < num) {
    const int result = sending_.send(sender_.get(), done, num - done);
    if (result > 0) {
      done += static_cast<std::size_t>(result);
      continue;
    }
    // Loopback that is down is waited for like a full queue.
    const bool is_waited_for =
        result == -EAGAIN || result == -ENOBUFS || result == -ENETDOWN || result == -ENETUNREACH;
    if (!is_waited_for || !wait_for_room(sender_.get(), -result, deadline)) break;
  }
  counters_.write_dropped += static_cast<std::int64_t>(num - done);
  return done;
}

const BusCounters& UdpBus::counters() {
  const std::int64_t count = kernel_drop_count(receiver_.get());
  if (count >= 0) drops_.note(static_cast<std::uint32_t>(count));
  if (counters_.kernel_dropped == 0 && drops_.total() > 0 && options_.on_event) {
    options_.on_event(url_ + ": the kernel dropped frames; its receive queue holds " +
                      std::to_string(granted_bytes_) + " bytes");
  }
  counters_.kernel_dropped = drops_.total();
  return counters_;
}

}  // namespace holdfast
