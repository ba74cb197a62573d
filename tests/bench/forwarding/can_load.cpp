// Closed-loop load for a CAN forwarder: keeps WINDOW frames in flight from one interface to
// another.
//
// The payload holds the time of sending (56 bits of ns) and one byte that a rule may alter, so that
// latency counts from the send call. Prints: frames/s, p50, p99 and maximum latency in us, lost
// frames.
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

namespace {

constexpr canid_t kIdentifier = 0x101;

std::int64_t now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

[[noreturn]] void fail(const std::string& what) {
  throw std::system_error(errno, std::generic_category(), what);
}

class RawCan {
 public:
  explicit RawCan(const char* interface_name) : socket_(socket(PF_CAN, SOCK_RAW, CAN_RAW)) {
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(if_nametoindex(interface_name));
    if (socket_ < 0 || address.can_ifindex == 0) fail(interface_name);
    const int buffer_bytes = 8 << 20;
    if (setsockopt(socket_, SOL_SOCKET, SO_RCVBUFFORCE, &buffer_bytes, sizeof buffer_bytes) != 0) {
      setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &buffer_bytes, sizeof buffer_bytes);
    }
    if (bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
      fail(interface_name);
    }
  }
  ~RawCan() { close(socket_); }
  RawCan(const RawCan&) = delete;
  RawCan& operator=(const RawCan&) = delete;

  void receive_nothing() const {
    if (setsockopt(socket_, SOL_CAN_RAW, CAN_RAW_FILTER, nullptr, 0) != 0) fail("no filter");
  }
  void set_timeout(std::chrono::milliseconds timeout) const {
    const timeval value{static_cast<time_t>(timeout.count() / 1000),
                        static_cast<suseconds_t>(timeout.count() % 1000 * 1000)};
    if (setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &value, sizeof value) != 0) fail("time-out");
  }
  void send_now() const {
    can_frame frame{};
    frame.can_id = kIdentifier;
    frame.can_dlc = 8;
    const std::int64_t time_ns = now_ns();
    std::memcpy(frame.data, &time_ns, 7);
    while (write(socket_, &frame, sizeof frame) != sizeof frame) {
      if (errno != ENOBUFS) fail("write");
    }
  }
  /// Latency of the next frame in ns, or -1 after the time-out.
  std::int64_t receive_latency_ns() const {
    can_frame frame{};
    while (read(socket_, &frame, sizeof frame) == sizeof frame) {
      if (frame.can_id != kIdentifier || frame.can_dlc != 8) continue;
      std::int64_t sent_ns = 0;
      std::memcpy(&sent_ns, frame.data, 7);
      return now_ns() - sent_ns;
    }
    if (errno != EAGAIN && errno != EINTR) fail("read");
    return -1;
  }

 private:
  int socket_;
};

// Waits until the forwarder forwards, then until none of the probes is under way any more.
bool forwarder_is_up(const RawCan& tx, const RawCan& rx) {
  rx.set_timeout(std::chrono::milliseconds(100));
  const std::int64_t deadline_ns = now_ns() + 20'000'000'000;
  bool is_up = false;
  while (!is_up && now_ns() < deadline_ns) {
    tx.send_now();
    is_up = rx.receive_latency_ns() >= 0;
  }
  while (is_up && rx.receive_latency_ns() >= 0) continue;
  return is_up;
}

int run(const char* from, const char* to, int window, int num_frames) {
  const RawCan tx(from), rx(to);
  tx.receive_nothing();
  if (!forwarder_is_up(tx, rx)) throw std::runtime_error("nothing is forwarded");
  rx.set_timeout(std::chrono::milliseconds(2000));
  std::vector<std::int64_t> latencies;
  latencies.reserve(static_cast<std::size_t>(num_frames));
  const std::int64_t start_ns = now_ns();
  std::int64_t end_ns = start_ns;
  int num_sent = 0;
  while (num_sent < std::min(window, num_frames)) {
    tx.send_now();
    ++num_sent;
  }
  while (static_cast<int>(latencies.size()) < num_frames) {
    const std::int64_t latency_ns = rx.receive_latency_ns();
    if (latency_ns < 0) break;  // what is still under way is lost
    latencies.push_back(latency_ns);
    end_ns = now_ns();
    if (num_sent < num_frames) {
      tx.send_now();
      ++num_sent;
    }
  }
  if (latencies.empty()) throw std::runtime_error("no frame came through");
  std::sort(latencies.begin(), latencies.end());
  const auto quantile_us = [&](double p) {
    return static_cast<double>(
               latencies[static_cast<std::size_t>(p * static_cast<double>(latencies.size() - 1))]) *
           1e-3;
  };
  std::printf("%.0f %.1f %.1f %.1f %d\n",
              static_cast<double>(latencies.size()) * 1e9 / static_cast<double>(end_ns - start_ns),
              quantile_us(0.5), quantile_us(0.99), quantile_us(1.0),
              num_sent - static_cast<int>(latencies.size()));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) {
    std::fprintf(stderr, "usage: bench_can_load FROM TO WINDOW FRAMES\n");
    return 2;
  }
  try {
    return run(argv[1], argv[2], std::atoi(argv[3]), std::atoi(argv[4]));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench_can_load: %s\n", error.what());
    return 1;
  }
}
