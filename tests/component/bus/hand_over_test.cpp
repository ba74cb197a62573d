// Frames that go to one socket while the next is awaited from another: io_uring where there is any,
// two calls elsewhere.
#include <linux/can.h>
#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <memory>
#include <optional>
#include <thread>

#include "drivers/can/ring_exchange.h"
#include "drivers/can/socketcan_bus.h"
#include "tests/support/bus_reading.h"
#include "tests/support/catch.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

struct Ends {
  Ends() {
    int ends[2];
    REQUIRE(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) == 0);
    ours = FileDescriptor(ends[0]);
    theirs = FileDescriptor(ends[1]);
  }
  FileDescriptor ours, theirs;
};

using Bytes = std::array<std::uint8_t, 4>;

Bytes bytes_of(std::uint32_t number) {
  return {static_cast<std::uint8_t>(number), static_cast<std::uint8_t>(number >> 8),
          static_cast<std::uint8_t>(number >> 16), static_cast<std::uint8_t>(number >> 24)};
}

void say(const FileDescriptor& end, std::uint32_t number) {
  const Bytes bytes = bytes_of(number);
  REQUIRE(send(end.get(), bytes.data(), bytes.size(), 0) == 4);
}

std::unique_ptr<RingExchange> open_ring(double wait_s) {
  auto ring = RingExchange::open(wait_s);
  if (!ring) WARN("this kernel has no io_uring for this process: its tests say nothing here");
  return ring;
}

bool has_ring() {
  return RingExchange::open(1.0) != nullptr;
}

constexpr double kShort_s = 0.001;

}  // namespace

TEST_CASE("a datagram goes out and the next one comes in, in one call") {
  const auto ring = open_ring(10.0);
  if (!ring) return;
  Ends from, to;
  Bytes room{}, seen{};
  say(from.theirs, 7);
  auto result = ring->exchange(from.ours.get(), room, to.ours.get(), {});
  CHECK(result.sent == 0);
  CHECK(result.received == 4);
  CHECK(room == bytes_of(7));
  // The partner answers only what it got, so that the frame must go before the wait.
  std::thread partner([&] {
    Bytes got{};
    if (recv(to.theirs.get(), got.data(), got.size(), 0) == 4 && got == bytes_of(7))
      send(from.theirs.get(), bytes_of(8).data(), 4, 0);
  });
  const Bytes out = room;
  result = ring->exchange(from.ours.get(), room, to.ours.get(), out);
  partner.join();
  CHECK(result.received == 4);
  CHECK(room == bytes_of(8));
  CHECK(recv(to.theirs.get(), seen.data(), seen.size(), MSG_DONTWAIT) < 0);  // once, not twice
}

TEST_CASE("when nothing comes the call comes back, and what comes later is the next call's") {
  const auto ring = open_ring(0.05);
  if (!ring) return;
  Ends from, to;
  Bytes room{};
  for (std::uint32_t i = 0; i < 3; ++i) {
    const std::int64_t start_ns = monotonic_time_ns();
    CHECK(ring->exchange(from.ours.get(), room, to.ours.get(), {}).received == -EAGAIN);
    CHECK(monotonic_time_ns() - start_ns >= 50'000'000);
    say(from.theirs, i);
    CHECK(ring->exchange(from.ours.get(), room, to.ours.get(), {}).received == 4);
    CHECK(room == bytes_of(i));
  }
}

TEST_CASE("what cannot be sent is told at once, and no datagram is lost for it") {
  const auto ring = open_ring(10.0);
  if (!ring) return;
  Ends from, to;
  Bytes room{};
  const Bytes out = bytes_of(1);
  while (send(to.ours.get(), out.data(), out.size(), MSG_DONTWAIT) == 4)
    continue;  // now it is full
  const std::int64_t start_ns = monotonic_time_ns();
  auto result = ring->exchange(from.ours.get(), room, to.ours.get(), out);
  CHECK(result.sent == -EAGAIN);
  CHECK(result.received == -EAGAIN);
  CHECK(monotonic_time_ns() - start_ns < 5'000'000'000);
  say(from.theirs, 2);
  result = ring->exchange(from.ours.get(), room, to.ours.get(), {});
  CHECK(result.received == 4);
  CHECK(room == bytes_of(2));
  to.theirs = FileDescriptor();
  say(from.theirs, 3);
  result = ring->exchange(from.ours.get(), room, to.ours.get(), out);
  CHECK(result.sent < 0);
  if (result.received != 4) result = ring->exchange(from.ours.get(), room, to.ours.get(), {});
  CHECK(result.received == 4);
  CHECK(room == bytes_of(3));
}

TEST_CASE("a longer datagram than there is room for tells its own length") {
  const auto ring = open_ring(10.0);
  if (!ring) return;
  Ends from, to;
  Bytes room{};
  const std::array<std::uint8_t, 100> longer{5, 6, 7, 8};
  REQUIRE(send(from.theirs.get(), longer.data(), longer.size(), 0) == 100);
  CHECK(ring->exchange(from.ours.get(), room, to.ours.get(), {}).received == 100);
  CHECK(room == Bytes{5, 6, 7, 8});
}

// Waits end, are cancelled, and datagrams come in the very moment.
TEST_CASE("no datagram is lost or comes twice, however the waits end") {
  const auto ring = open_ring(kShort_s);
  if (!ring) return;
  Ends from, to;
  constexpr std::uint32_t kNum = 3000;
  std::thread writer([&] {
    for (std::uint32_t i = 0; i < kNum; ++i) {
      // From none to about two waits between them.
      const std::int64_t until_ns = monotonic_time_ns() + (i * 7919 % 2000) * 1000;
      while (i % 4 == 0 && monotonic_time_ns() < until_ns) std::this_thread::yield();
      const Bytes bytes = bytes_of(i);
      send(from.theirs.get(), bytes.data(), bytes.size(), 0);
    }
  });
  Bytes room{};
  std::uint32_t next = 0;
  int num_empty = 0, num_odd = 0;
  const std::int64_t end_ns = monotonic_time_ns() + 60'000'000'000;
  while (next < kNum && monotonic_time_ns() < end_ns) {
    const auto result = ring->exchange(from.ours.get(), room, to.ours.get(), {});
    if (result.received == -EAGAIN) {
      ++num_empty;
    } else {
      num_odd += result.received != 4 || room != bytes_of(next) ? 1 : 0;
      ++next;
    }
  }
  writer.join();
  CHECK(next == kNum);
  CHECK(num_odd == 0);
  CHECK(num_empty > 0);
}

TEST_CASE("frames handed over from bus to bus keep their order, one by one and in floods") {
  for (const bool has_times : {false, true}) {
    Ends in, out;
    BusOptions options;
    options.wants_receive_times = has_times;
    SocketCanBus source(std::move(in.theirs), "source", writable());
    SocketCanBus from(std::move(in.ours), "from", options);
    BusOptions writing = writable();
    writing.wants_receive_times = false;
    SocketCanBus to(std::move(out.ours), "to", writing);
    SocketCanBus sink(std::move(out.theirs), "sink", {});
    constexpr std::uint32_t kNum = 4000, kNumAlone = 20;
    std::array<CanFrame, 64> batch;
    std::size_t count = 0, num_read = 0;
    for (std::uint32_t i = 0; i < kNumAlone; ++i) {
      source.write(std::array{numbered_frame(i)});
      count = from.hand_over(to, std::span(batch).first(count), batch);
      REQUIRE(count == 1);
      ++num_read;
    }
    CHECK((from.num_exchanged() > 0) == (has_ring() && !has_times));
    // Ones, pauses and bursts that are longer than the queue of the second pair.
    std::thread writer([&] {
      for (std::uint32_t i = kNumAlone; i < kNum;) {
        const std::uint32_t burst = i % 5 == 0 ? 700 : 1;
        std::vector<CanFrame> frames;
        for (std::uint32_t j = 0; j < burst && i < kNum; ++j) frames.push_back(numbered_frame(i++));
        source.write(frames);
        std::this_thread::yield();
      }
    });
    std::vector<CanFrame> arrived;
    std::thread reader([&] { arrived = read_frames(sink, kNum); });
    const std::int64_t end_ns = monotonic_time_ns() + 60'000'000'000;
    while (num_read < kNum && monotonic_time_ns() < end_ns) {
      count = from.hand_over(to, std::span(batch).first(count), batch);
      num_read += count;
    }
    to.write(std::span(batch).first(count));
    writer.join();
    reader.join();
    REQUIRE(arrived.size() == kNum);
    int num_odd = 0;
    for (std::uint32_t i = 0; i < kNum; ++i) num_odd += number_of(arrived[i]) != i ? 1 : 0;
    CHECK(num_odd == 0);
    CHECK(from.counters().read == kNum);
    CHECK(to.counters().written == kNum);
    CHECK(to.counters().write_dropped == 0);
  }
}

TEST_CASE("a handed over frame that nobody takes is counted, and so is one that no bus carries") {
  Ends in, out;
  BusOptions options = writable(0.05);
  options.wants_receive_times = false;
  SocketCanBus source(std::move(in.theirs), "source", writable());
  SocketCanBus from(std::move(in.ours), "from", options);
  SocketCanBus to(std::move(out.ours), "to", options);
  std::array<CanFrame, 8> frames;
  // Frames that come one by one are handed over in one call.
  const auto hand_over = [&](const CanFrame& frame) {
    source.write(std::array{numbered_frame(1)});
    return from.hand_over(to, std::span(&frame, 1), frames);
  };
  CanFrame wrong = numbered_frame(2);
  wrong.num_bytes = 9;
  for (int i = 0; i < 3; ++i) CHECK(hand_over(wrong) == 1);
  CHECK(to.counters().write_dropped == 3);
  while (to.write(std::array{numbered_frame(3)}) == 1) continue;
  const BusCounters before = to.counters();
  for (int i = 0; i < 3; ++i) {
    // What had not come when the send failed comes with the next read.
    if (hand_over(numbered_frame(4)) == 0) CHECK(from.read(frames) == 1);
  }
  CHECK(to.counters().write_dropped == before.write_dropped + 3);
  CHECK(to.counters().written == before.written);
  CHECK((from.num_exchanged() > 0) == has_ring());
}

TEST_CASE("after a hand over that found nothing the descriptor tells of frames again") {
  Ends in, out;
  BusOptions options = writable();
  options.wants_receive_times = false;
  auto source = std::make_unique<SocketCanBus>(std::move(in.theirs), "source", writable());
  SocketCanBus from(std::move(in.ours), "from", options);
  SocketCanBus to(std::move(out.ours), "to", options);
  std::array<CanFrame, 8> frames;
  const auto tells = [&from] {
    pollfd wake{from.file_descriptor(), POLLIN, 0};
    return poll(&wake, 1, 0) == 1;
  };
  for (std::uint32_t i = 0; i < 2; ++i) {
    source->write(std::array{numbered_frame(i)});
    REQUIRE(from.hand_over(to, {}, frames) == 1);
  }
  CHECK(from.hand_over(to, {}, frames) == 0);
  source->write(std::array{numbered_frame(3)});
  CHECK(tells());
  REQUIRE(from.hand_over(to, {}, frames) == 1);
  source.reset();
  CHECK(from.hand_over(to, {}, frames) == 0);
  CHECK(from.at_end());
  CHECK_FALSE(tells());
}
