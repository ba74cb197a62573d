#include "drivers/can/datagram_batch.h"

#include <linux/sock_diag.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <system_error>

#include "common/clock.h"

namespace holdfast {
namespace {

// Two control messages: a time stamp of 16 bytes and a counter of 4, each with header and padding.
constexpr std::size_t kControlBytes = 128;

}  // namespace

ReceiveBatch::ReceiveBatch(std::size_t bytes_max)
    : bytes_max_(bytes_max),
      data_(kBatchMax * bytes_max),
      controls_(kBatchMax * kControlBytes),
      vectors_(kBatchMax),
      headers_(kBatchMax),
      senders_(kBatchMax),
      times_ns_(kBatchMax) {
  for (std::size_t i = 0; i < kBatchMax; ++i) {
    vectors_[i] = {data_.data() + i * bytes_max, bytes_max};
    headers_[i].msg_hdr.msg_iov = &vectors_[i];
    headers_[i].msg_hdr.msg_iovlen = 1;
    headers_[i].msg_hdr.msg_name = &senders_[i];
    headers_[i].msg_hdr.msg_control = controls_.data() + i * kControlBytes;
  }
}

int ReceiveBatch::receive(int fd, std::size_t num_max, bool is_waiting) {
  num_max = std::min(num_max, kBatchMax);
  for (std::size_t i = 0; i < num_max; ++i) {
    headers_[i].msg_hdr.msg_namelen = sizeof(sockaddr_in);
    headers_[i].msg_hdr.msg_controllen = kControlBytes;
    headers_[i].msg_hdr.msg_flags = 0;
  }
  int result = 0;
  do {
    result = recvmmsg(fd, headers_.data(), static_cast<unsigned>(num_max),
                      is_waiting ? MSG_WAITFORONE : MSG_DONTWAIT, nullptr);
  } while (result < 0 && errno == EINTR);
  if (result < 0) return -errno;
  for (int i = 0; i < result; ++i) read_controls(static_cast<std::size_t>(i));
  return result;
}

int ReceiveBatch::receive_one(int fd) {
  ssize_t result = 0;
  do {
    result = recv(fd, data_.data(), bytes_max_, MSG_TRUNC);
  } while (result < 0 && errno == EINTR);
  return note_one(result < 0 ? -errno : result);
}

int ReceiveBatch::note_one(std::int64_t length) {
  if (length < 0) return static_cast<int>(length);
  // With MSG_TRUNC the length is the datagram's own, which may be more than was kept.
  const auto own = static_cast<std::size_t>(length);
  headers_[0].msg_len = static_cast<unsigned>(std::min(own, bytes_max_));
  headers_[0].msg_hdr.msg_flags = own > bytes_max_ ? MSG_TRUNC : 0;
  times_ns_[0] = 0;
  return 1;
}

std::span<const std::uint8_t> ReceiveBatch::bytes(std::size_t i) const {
  return {data_.data() + i * bytes_max_, headers_[i].msg_len};
}

void ReceiveBatch::read_controls(std::size_t i) {
  times_ns_[i] = 0;
  msghdr* header = &headers_[i].msg_hdr;
  for (cmsghdr* control = CMSG_FIRSTHDR(header); control != nullptr;
       control = CMSG_NXTHDR(header, control)) {
    if (control->cmsg_level != SOL_SOCKET) continue;
    if (control->cmsg_type == SO_TIMESTAMPNS) {
      timespec stamp{};
      std::memcpy(&stamp, CMSG_DATA(control), sizeof stamp);
      times_ns_[i] = static_cast<std::int64_t>(stamp.tv_sec) * 1'000'000'000 + stamp.tv_nsec;
    } else if (control->cmsg_type == SO_RXQ_OVFL) {
      std::memcpy(&kernel_drops_, CMSG_DATA(control), sizeof kernel_drops_);
    }
  }
}

SendBatch::SendBatch(std::size_t bytes_max)
    : bytes_max_(bytes_max),
      data_(kBatchMax * bytes_max),
      vectors_(kBatchMax),
      headers_(kBatchMax) {
  for (std::size_t i = 0; i < kBatchMax; ++i) {
    vectors_[i] = {data_.data() + i * bytes_max, 0};
    headers_[i].msg_hdr.msg_iov = &vectors_[i];
    headers_[i].msg_hdr.msg_iovlen = 1;
  }
}

std::span<std::uint8_t> SendBatch::slot(std::size_t i) {
  return {data_.data() + i * bytes_max_, bytes_max_};
}

int SendBatch::send(int fd, std::size_t first, std::size_t num) {
  if (num == 1) return send_one(fd, first);
  int result = 0;
  do {
    result = sendmmsg(fd, headers_.data() + first, static_cast<unsigned>(num),
                      MSG_DONTWAIT | MSG_NOSIGNAL);
  } while (result < 0 && errno == EINTR);
  return result < 0 ? -errno : result;
}

// The kernel's shortest way for what is most frequent.
int SendBatch::send_one(int fd, std::size_t i) {
  ssize_t result = 0;
  do {
    result = ::send(fd, vectors_[i].iov_base, vectors_[i].iov_len, MSG_DONTWAIT | MSG_NOSIGNAL);
  } while (result < 0 && errno == EINTR);
  return result < 0 ? -errno : 1;
}

void DropCounter::note(std::uint32_t kernel_count) {
  // A datagram that waited carries an older count than one that was asked for meanwhile.
  const auto difference = static_cast<std::int32_t>(kernel_count - last_);
  if (difference <= 0) return;
  total_ += difference;
  last_ = kernel_count;
}

int prepare_receiving(int fd, int buffer_bytes, bool wants_stamps) {
  const int on = 1;
  if (wants_stamps) setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
  setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
  if (setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &buffer_bytes, sizeof buffer_bytes) != 0) {
    setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &buffer_bytes, sizeof buffer_bytes);
  }
  int granted = 0;
  socklen_t size = sizeof granted;
  getsockopt(fd, SOL_SOCKET, SO_RCVBUF, &granted, &size);
  return granted;
}

std::int64_t kernel_drop_count(int fd) {
  std::array<std::uint32_t, SK_MEMINFO_VARS> values{};
  socklen_t size = sizeof values;
  if (getsockopt(fd, SOL_SOCKET, SO_MEMINFO, values.data(), &size) != 0) return -1;
  if (size < (SK_MEMINFO_DROPS + 1) * sizeof values[0]) return -1;
  return values[SK_MEMINFO_DROPS];
}

int WriteDeadline::left_ms() {
  const std::int64_t now_ns = monotonic_time_ns();
  if (deadline_ns_ == 0) deadline_ns_ = now_ns + static_cast<std::int64_t>(timeout_s_ * 1e9);
  const double left_ms = std::ceil(static_cast<double>(deadline_ns_ - now_ns) * 1e-6);
  constexpr double kLongestMs = 3.6e6;  // fits an int whatever time-out was asked for
  return static_cast<int>(std::clamp(left_ms, 0.0, kLongestMs));
}

bool wait_for_room(int fd, int error, WriteDeadline& deadline) {
  const int left_ms = deadline.left_ms();
  if (left_ms == 0) return false;
  if (error == EAGAIN) {
    pollfd room{fd, POLLOUT, 0};
    poll(&room, 1, left_ms);
  } else {
    poll(nullptr, 0, 1);
  }
  return true;
}

std::string system_problem(const std::string& what, int error) {
  return what + ": " + std::generic_category().message(error);
}

}  // namespace holdfast
