#pragma once

#include <netinet/in.h>
#include <sys/socket.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace holdfast {

/// Datagrams taken or given in one system call at most.
inline constexpr std::size_t kBatchMax = 64;

/// Buffers for recvmmsg with the kernel's receive stamps and drop count; allocates only when made.
class ReceiveBatch {
 public:
  /// Longer datagrams than bytes_max are cut and told by is_cut().
  explicit ReceiveBatch(std::size_t bytes_max);

  /// Takes up to num_max waiting datagrams; returns their number, or -errno (-EAGAIN when none
  /// waits). is_waiting: waits for the first one as long as the socket's SO_RCVTIMEO.
  int receive(int fd, std::size_t num_max, bool is_waiting = false);

  /// Waits for one datagram, as long as the socket's SO_RCVTIMEO, by the kernel's shortest way: no
  /// stamp, no drop count. Returns 1 or -errno.
  int receive_one(int fd);

  /// Where another call puts a datagram; tell note_one() what that call returned.
  std::span<std::uint8_t> room() { return {data_.data(), bytes_max_}; }
  /// The datagram in room() is now the first one: length is its own, or -errno. Returns 1 or that.
  int note_one(std::int64_t length);

  std::span<const std::uint8_t> bytes(std::size_t i) const;
  bool is_cut(std::size_t i) const { return (headers_[i].msg_hdr.msg_flags & MSG_TRUNC) != 0; }
  /// Wall clock, nanoseconds; 0 when the kernel gave no stamp.
  std::int64_t receive_time_ns(std::size_t i) const { return times_ns_[i]; }
  const sockaddr_in& sender(std::size_t i) const { return senders_[i]; }
  /// The kernel's drop counter as the latest datagram carried it.
  std::uint32_t kernel_drops() const { return kernel_drops_; }

 private:
  void read_controls(std::size_t i);

  std::size_t bytes_max_;
  std::vector<std::uint8_t> data_, controls_;
  std::vector<iovec> vectors_;
  std::vector<mmsghdr> headers_;
  std::vector<sockaddr_in> senders_;
  std::vector<std::int64_t> times_ns_;
  std::uint32_t kernel_drops_ = 0;
};

/// Buffers for sendmmsg on a connected or bound socket; allocates only when made.
class SendBatch {
 public:
  explicit SendBatch(std::size_t bytes_max);

  std::span<std::uint8_t> slot(std::size_t i);
  std::span<const std::uint8_t> filled(std::size_t i) const {
    return {data_.data() + i * bytes_max_, vectors_[i].iov_len};
  }
  void set_size(std::size_t i, std::size_t num_bytes) { vectors_[i].iov_len = num_bytes; }
  /// Sends slots first..first+num-1 in order; returns how many the kernel took, or -errno.
  int send(int fd, std::size_t first, std::size_t num);

 private:
  int send_one(int fd, std::size_t i);

  std::size_t bytes_max_;
  std::vector<std::uint8_t> data_;
  std::vector<iovec> vectors_;
  std::vector<mmsghdr> headers_;
};

/// Adds up a 32-bit kernel counter that is read from two places and may wrap.
class DropCounter {
 public:
  void note(std::uint32_t kernel_count);
  std::int64_t total() const { return total_; }

 private:
  std::uint32_t last_ = 0;
  std::int64_t total_ = 0;
};

/// Asks for the receive buffer, past the system's limit where the process may, and for receive
/// stamps and the drop counter. Returns the bytes that the kernel granted.
int prepare_receiving(int fd, int buffer_bytes, bool wants_stamps = true);

/// The kernel's own drop counter of a socket (SO_MEMINFO): it also knows the last losses, which the
/// counter on the datagrams tells only with a later one. Negative when this kernel has none.
std::int64_t kernel_drop_count(int fd);

/// Time that write() may still wait. The clock starts with the first wait.
class WriteDeadline {
 public:
  explicit WriteDeadline(double timeout_s) : timeout_s_(timeout_s) {}
  /// Milliseconds left, rounded up; 0 when the time is over.
  int left_ms();

 private:
  double timeout_s_;
  std::int64_t deadline_ns_ = 0;
};

/// Waits for room after EAGAIN (until writable) or ENOBUFS (a millisecond: a full device queue
/// wakes nobody). False when the deadline is over.
bool wait_for_room(int fd, int error, WriteDeadline& deadline);

/// "what: reason of errno".
std::string system_problem(const std::string& what, int error);

}  // namespace holdfast
