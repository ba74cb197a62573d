#pragma once

#include <liburing.h>

#include <cstdint>
#include <memory>
#include <span>

namespace holdfast {

/// Sends a datagram and waits for the next one in a single system call (io_uring), where a plain
/// forwarder needs two. One thread.
class RingExchange {
 public:
  struct Result {
    int sent = 0;      // bytes, or -errno; 0 when there was nothing to send
    int received = 0;  // the datagram's own length, or -errno: -EAGAIN when none came in time
  };

  /// wait_s: how long a datagram is waited for at least; at most twice as long. Null where the
  /// kernel has no io_uring (of Linux 6.1), or this process may not use it.
  static std::unique_ptr<RingExchange> open(double wait_s);

  RingExchange(const RingExchange&) = delete;
  RingExchange& operator=(const RingExchange&) = delete;
  ~RingExchange();

  /// Sends out (if it has bytes) to one socket without waiting for room, then waits for a datagram
  /// from the other one. Nothing is left under way: a datagram that comes later is the next call's.
  /// A failed send is told at once, with -EAGAIN for a datagram that had not come.
  Result exchange(int from, std::span<std::uint8_t> room, int to,
                  std::span<const std::uint8_t> out);

 private:
  explicit RingExchange(double wait_s);

  void add_receive(int from, std::span<std::uint8_t> room);
  void add_send(int to, std::span<const std::uint8_t> out);
  void add_tick();
  int wait();
  void take_results();
  void cancel_receive();

  io_uring ring_{};
  __kernel_timespec wait_{};
  // What is under way. The clock's tick outlives a call: one for each wait, not for each datagram.
  bool is_receiving_ = false, has_tick_ = false, is_cancelling_ = false;
  Result result_;
};

}  // namespace holdfast
