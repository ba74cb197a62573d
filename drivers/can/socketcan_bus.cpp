#include "drivers/can/socketcan_bus.h"

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/epoll.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "common/errors.h"
#include "drivers/can/ring_exchange.h"

namespace holdfast {

static_assert(sizeof(canfd_frame) == kKernelFrameBytesMax);

std::optional<CanFrame> from_kernel_frame(std::span<const std::uint8_t> bytes) {
  const bool is_fd = bytes.size() == sizeof(canfd_frame);
  if (!is_fd && bytes.size() != sizeof(can_frame)) return std::nullopt;
  // Both forms begin alike: identifier, length, FD flags, two spare bytes, data.
  canfd_frame kernel{};
  std::memcpy(&kernel, bytes.data(), bytes.size());
  CanFrame frame;
  if (is_fd) {
    frame.flags = CanFrame::kFd;
    if ((kernel.flags & CANFD_BRS) != 0) frame.flags |= CanFrame::kBitRateSwitch;
    if ((kernel.flags & CANFD_ESI) != 0) frame.flags |= CanFrame::kErrorStateIndicator;
  }
  if ((kernel.can_id & CAN_RTR_FLAG) != 0) frame.flags |= CanFrame::kRemote;
  if ((kernel.can_id & CAN_ERR_FLAG) != 0) {
    frame.flags |= CanFrame::kError;
    frame.identifier = kernel.can_id & CAN_ERR_MASK;
  } else if ((kernel.can_id & CAN_EFF_FLAG) != 0) {
    frame.flags |= CanFrame::kExtended;
    frame.identifier = kernel.can_id & CAN_EFF_MASK;
  } else {
    frame.identifier = kernel.can_id & CAN_SFF_MASK;
  }
  frame.num_bytes = kernel.len;
  if (!is_valid(frame)) return std::nullopt;
  std::copy_n(kernel.data, frame.bytes().size(), frame.data.begin());
  return frame;
}

std::size_t to_kernel_frame(const CanFrame& frame, std::span<std::uint8_t> bytes) {
  if (!is_valid(frame) || frame.has(CanFrame::kError)) return 0;
  canfd_frame kernel{};
  kernel.can_id = frame.identifier;
  if (frame.has(CanFrame::kExtended)) kernel.can_id |= CAN_EFF_FLAG;
  if (frame.has(CanFrame::kRemote)) kernel.can_id |= CAN_RTR_FLAG;
  kernel.len = frame.num_bytes;
  if (frame.has(CanFrame::kBitRateSwitch)) kernel.flags |= CANFD_BRS;
  if (frame.has(CanFrame::kErrorStateIndicator)) kernel.flags |= CANFD_ESI;
  std::copy(frame.bytes().begin(), frame.bytes().end(), kernel.data);
  const std::size_t size = frame.has(CanFrame::kFd) ? sizeof(canfd_frame) : sizeof(can_frame);
  std::memcpy(bytes.data(), &kernel, size);
  return size;
}

std::string describe_error_frame(const CanFrame& frame) {
  const std::uint32_t error_class = frame.identifier;
  if ((error_class & CAN_ERR_BUSOFF) != 0) return "bus-off";
  if ((error_class & CAN_ERR_RESTARTED) != 0) return "restarted";
  if ((error_class & CAN_ERR_TX_TIMEOUT) != 0) return "transmit time-out";
  if ((error_class & CAN_ERR_TRX) != 0) return "transceiver error";
  if ((error_class & CAN_ERR_CRTL) == 0) return "";
  constexpr std::array<std::pair<int, const char*>, 5> kStates = {{
      {CAN_ERR_CRTL_RX_OVERFLOW, "receive overflow in the controller"},
      {CAN_ERR_CRTL_TX_OVERFLOW, "transmit overflow in the controller"},
      {CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE, "error-passive"},
      {CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING, "error-warning"},
      {0x40, "error-active again"},  // CAN_ERR_CRTL_ACTIVE, missing in older headers
  }};
  for (const auto& [bits, text] : kStates) {
    if ((frame.data[1] & bits) != 0) return text;
  }
  return "";
}

SocketCanBus::SocketCanBus(const std::string& interface_name, const BusOptions& options)
    : name_(interface_name),
      options_(options),
      monitor_(std::make_unique<LinkMonitor>()),
      received_(kKernelFrameBytesMax),
      sending_(kKernelFrameBytesMax) {
  open_socket();
  const NetworkLink link = read_network_link(name_);
  if (link.index == 0) {
    throw JobError("socketcan:" + name_ + ": there is no interface of this name");
  }
  if (options_.may_write && !may_write_to_interface()) {
    throw UsageError(
        "socketcan:" + name_ +
        ": not a virtual bus; writing to it needs --i-own-this-bus socketcan:" + name_);
  }
  bind_to(link.index);
  watch(socket_.get());
  watch(monitor_->file_descriptor());
  check_link();
}

SocketCanBus::SocketCanBus(FileDescriptor open_socket, const std::string& name,
                           const BusOptions& options)
    : name_(name),
      options_(options),
      socket_(std::move(open_socket)),
      received_(kKernelFrameBytesMax),
      sending_(kKernelFrameBytesMax) {
  prepare_socket();
  watch(socket_.get());
}

SocketCanBus::~SocketCanBus() = default;

void SocketCanBus::prepare_socket() {
  const timeval wait{0, static_cast<suseconds_t>(kReadWait_s * 1e6)};
  setsockopt(socket_.get(), SOL_SOCKET, SO_RCVTIMEO, &wait, sizeof wait);
  granted_bytes_ =
      prepare_receiving(socket_.get(), options_.receive_buffer_bytes, options_.wants_receive_times);
}

void SocketCanBus::open_socket() {
  // Blocking, so that read_waiting() may wait; all other calls pass MSG_DONTWAIT.
  socket_ = FileDescriptor(socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW));
  if (!socket_.is_open()) {
    throw JobError(
        system_problem("socketcan:" + name_ + ": this kernel offers no CAN sockets", errno) +
        "; use udp:239.74.163.2:43113, or scripts/with-vcan");
  }
  const int on = 1;
  const can_err_mask_t all_errors = CAN_ERR_MASK;
  // Without the first option FD frames of others would be left out without a word.
  if (setsockopt(socket_.get(), SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) != 0 ||
      setsockopt(socket_.get(), SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &all_errors, sizeof all_errors) !=
          0) {
    throw JobError(system_problem("socketcan:" + name_ + ": raw CAN options", errno));
  }
  prepare_socket();
}

void SocketCanBus::watch(int fd) {
  if (!wake_.is_open()) wake_ = FileDescriptor(epoll_create1(EPOLL_CLOEXEC));
  epoll_event event{};
  event.events = EPOLLIN;
  if (epoll_ctl(wake_.get(), EPOLL_CTL_ADD, fd, &event) != 0) {
    throw JobError(system_problem(name_ + ": cannot be watched", errno));
  }
}

void SocketCanBus::set_lingering(bool is_lingering) {
  if (is_lingering == is_lingering_ || at_end_) return;
  is_lingering_ = is_lingering;
  if (is_lingering) {
    epoll_ctl(wake_.get(), EPOLL_CTL_DEL, socket_.get(), nullptr);
  } else {
    watch(socket_.get());
  }
}

bool SocketCanBus::may_write_to_interface() const {
  return options_.owns("socketcan:" + name_) || is_virtual_can(name_);
}

void SocketCanBus::bind_to(int index) {
  // With the interface the kernel also takes the socket's filters away: all frames must be asked
  // for.
  const can_filter all_frames{};
  setsockopt(socket_.get(), SOL_CAN_RAW, CAN_RAW_FILTER, &all_frames,
             options_.wants_frames ? sizeof all_frames : 0);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = index;
  void* const place = &address;
  if (bind(socket_.get(), static_cast<sockaddr*>(place), sizeof address) != 0) {
    throw JobError(system_problem("socketcan:" + name_ + ": cannot be bound", errno));
  }
  bound_index_ = index;
}

void SocketCanBus::check_link() {
  const NetworkLink link = read_network_link(name_);
  if (link.index != bound_index_) set_state(State::kGone);
  // An interface that came back as hardware under a virtual one's name is no longer ours to write
  // to.
  if (link.index == 0 || (options_.may_write && !may_write_to_interface())) {
    return set_state(State::kGone);
  }
  if (link.index != bound_index_) {
    try {
      bind_to(link.index);
    } catch (const JobError&) {
      return;  // it went away again between the two calls; the monitor tells when it is back
    }
  }
  mtu_ = link.mtu;
  set_state(link.is_up ? State::kUp : State::kDown);
}

void SocketCanBus::set_state(State state) {
  if (state == state_) return;
  if (state_ == State::kUp) ++counters_.times_down;
  state_ = state;
  if (state == State::kUp) {
    is_bus_off_ = false;
    // The error of the time that is over would else be read as a new one.
    int pending = 0;
    socklen_t size = sizeof pending;
    getsockopt(socket_.get(), SOL_SOCKET, SO_ERROR, &pending, &size);
    return tell(name_ + " is up again");
  }
  tell(name_ + (state == State::kDown ? " is down: waiting" : " is gone: waiting"));
}

std::size_t SocketCanBus::read_frames(std::span<CanFrame> frames, bool is_waiting) {
  set_lingering(is_waiting);
  std::size_t num_read = 0;
  while (num_read < frames.size() && !at_end_) {
    const std::size_t wanted = std::min(frames.size() - num_read, kBatchMax);
    const bool waits = is_waiting && num_read == 0;
    const bool takes_one = waits && singles_left_ > 0;
    const int result = takes_one ? received_.receive_one(socket_.get())
                                 : received_.receive(socket_.get(), wanted, waits);
    // Where frames come one by one, most are taken by the shorter call; the longer one between them
    // sees when they begin to queue.
    if (takes_one) --singles_left_;
    if (waits && !takes_one)
      singles_left_ = result == 1 && !options_.wants_receive_times ? kSinglesMax : 0;
    if (result <= 0) {
      on_read_error(-result);
      break;
    }
    const auto num_received = static_cast<std::size_t>(result);
    for (std::size_t i = 0; i < num_received; ++i) {
      if (take(i, frames[num_read])) ++num_read;
    }
    if (num_received < wanted || takes_one) break;
  }
  if (num_read == 0) set_lingering(false);
  counters_.read += static_cast<std::int64_t>(num_read);
  return num_read;
}

// Where frames queue, the batches of the calls apart are the shorter way; and only those calls
// bring receive times.
bool SocketCanBus::can_exchange() {
  if (singles_left_ == 0 || at_end_) return false;
  if (!std::exchange(has_tried_ring_, true)) ring_ = RingExchange::open(kReadWait_s);
  return ring_ != nullptr;
}

std::size_t SocketCanBus::hand_over(CanBus& to, std::span<const CanFrame> out,
                                    std::span<CanFrame> frames) {
  auto* const other = dynamic_cast<SocketCanBus*>(&to);
  if (other == nullptr || out.size() > 1 || frames.empty() || !can_exchange())
    return CanBus::hand_over(to, out, frames);
  --singles_left_;
  ++num_exchanged_;
  set_lingering(true);
  const bool has_frame = other->prepare_one(out) > 0;
  const RingExchange::Result result =
      ring_->exchange(socket_.get(), received_.room(), other->socket_.get(),
                      has_frame ? other->sending_.filled(0) : std::span<const std::uint8_t>());
  if (has_frame) other->finish_one(result.sent);
  const int received = received_.note_one(result.received);
  if (received < 0) on_read_error(-received);
  const std::size_t num_read = received > 0 && take(0, frames[0]) ? 1 : 0;
  if (num_read == 0) set_lingering(false);
  counters_.read += static_cast<std::int64_t>(num_read);
  return num_read;
}

// The frame in the first slot, if it may go at once; what may not has gone the longer way, or is
// counted.
std::size_t SocketCanBus::prepare_one(std::span<const CanFrame> out) {
  if (out.empty()) return 0;
  if (options_.may_write && !is_bus_off_) return fill(out);
  write(out);
  return 0;
}

// A queue that was full is waited for as write() does.
void SocketCanBus::finish_one(int sent) {
  if (sent < 0) {
    WriteDeadline deadline(options_.write_timeout_s);
    sent = static_cast<int>(send_filled(1, deadline));
  }
  if (sent > 0) ++counters_.written;
}

bool SocketCanBus::take(std::size_t i, CanFrame& frame) {
  if (received_.bytes(i).empty()) {  // how a socketpair says that the other end is closed
    on_read_error(ECONNRESET);
    return false;
  }
  drops_.note(received_.kernel_drops());
  const auto read_frame =
      received_.is_cut(i) ? std::nullopt : from_kernel_frame(received_.bytes(i));
  if (!read_frame) {
    ++counters_.refused;
    return false;
  }
  if (read_frame->has(CanFrame::kError)) {
    on_error_frame(*read_frame);
    return false;
  }
  frame = *read_frame;
  frame.receive_time_ns = received_.receive_time_ns(i);
  return true;
}

void SocketCanBus::on_error_frame(const CanFrame& frame) {
  ++counters_.error_frames;
  if ((frame.identifier & CAN_ERR_BUSOFF) != 0) is_bus_off_ = true;
  if ((frame.identifier & CAN_ERR_RESTARTED) != 0) is_bus_off_ = false;
  const std::string text = describe_error_frame(frame);
  // Some controllers repeat their state with every bus error: only a change is worth telling.
  if (text.empty() || text == last_error_text_) return;
  last_error_text_ = text;
  tell(name_ + ": " + text);
}

void SocketCanBus::on_read_error(int error) {
  if (!monitor_) {
    if (error == EAGAIN || at_end_) return;
    set_lingering(true);  // a closed socketpair would wake without end
    at_end_ = true;
    return;
  }
  if (error == ENODEV || error == ENXIO) {
    bound_index_ = 0;
    set_state(State::kGone);
  } else if (error == ENETDOWN) {
    set_state(State::kDown);
  }
  const bool has_changes = monitor_->take_changes();
  if (has_changes || error != EAGAIN) check_link();
}

std::size_t SocketCanBus::write(std::span<const CanFrame> frames) {
  if (!options_.may_write) throw std::logic_error(name_ + " was opened read-only");
  if (is_bus_off_) {
    // The kernel would take frames and lose them without a word.
    counters_.write_dropped += static_cast<std::int64_t>(frames.size());
    return 0;
  }
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

std::size_t SocketCanBus::fill(std::span<const CanFrame> frames) {
  std::size_t num_filled = 0;
  for (const CanFrame& frame : frames) {
    const std::size_t size = to_kernel_frame(frame, sending_.slot(num_filled));
    const bool is_too_long = size > static_cast<std::size_t>(mtu_);
    if (is_too_long && !std::exchange(told_mtu_, true)) {
      tell(name_ + " carries classic frames only (its MTU is " + std::to_string(mtu_) +
           "): CAN FD frames are dropped; allow them with: ip link set " + name_ + " mtu 72");
    }
    if (size == 0 || is_too_long) {
      ++counters_.write_dropped;
    } else {
      sending_.set_size(num_filled++, size);
    }
  }
  return num_filled;
}

std::size_t SocketCanBus::send_filled(std::size_t num, WriteDeadline& deadline) {
  std::size_t done = 0, num_dropped = 0;
  while (done < num) {
    const int result = sending_.send(socket_.get(), done, num - done);
    if (result > 0) {
      done += static_cast<std::size_t>(result);
    } else if (result == -EINVAL || result == -EMSGSIZE) {
      ++num_dropped, ++done;  // this one frame only
    } else if (!wait_after(-result, deadline)) {
      num_dropped += num - done;
      break;
    }
  }
  counters_.write_dropped += static_cast<std::int64_t>(num_dropped);
  return num - num_dropped;
}

bool SocketCanBus::wait_after(int error, WriteDeadline& deadline) {
  if (error == EAGAIN || error == ENOBUFS) return wait_for_room(socket_.get(), error, deadline);
  if (!monitor_ || (error != ENETDOWN && error != ENODEV && error != ENXIO)) return false;
  on_read_error(error);
  if (state_ == State::kUp) return wait_for_room(-1, ENOBUFS, deadline);
  const int left_ms = deadline.left_ms();
  pollfd change{monitor_->file_descriptor(), POLLIN, 0};
  if (left_ms == 0) return false;
  poll(&change, 1, left_ms);
  if (monitor_->take_changes()) check_link();
  return true;
}

void SocketCanBus::note_drops() {
  const std::int64_t count = kernel_drop_count(socket_.get());
  if (count >= 0) drops_.note(static_cast<std::uint32_t>(count));
}

const BusCounters& SocketCanBus::counters() {
  note_drops();
  if (counters_.kernel_dropped == 0 && drops_.total() > 0) {
    tell(name_ + ": the kernel dropped frames; its receive queue holds " +
         std::to_string(granted_bytes_) + " bytes");
  }
  counters_.kernel_dropped = drops_.total();
  return counters_;
}

void SocketCanBus::tell(const std::string& text) const {
  if (options_.on_event) options_.on_event(text);
}

}  // namespace holdfast
