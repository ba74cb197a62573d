#include "drivers/can/socketcan_bus.h"

#include <linux/can.h>
#include <linux/can/error.h>
#include <poll.h>
#include <sys/socket.h>

#include <cstring>
#include <memory>
#include <stdexcept>
#include <thread>

#include "tests/support/bus_reading.h"
#include "tests/support/catch.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

// Two ends that carry datagrams in order, as a CAN socket does, where the kernel has no CAN.
struct Pair {
  Pair() {
    int ends[2];
    REQUIRE(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) == 0);
    near = FileDescriptor(ends[0]);
    far = FileDescriptor(ends[1]);
  }
  FileDescriptor near, far;
};

void send_raw(int fd, std::uint32_t id, int length, std::size_t size) {
  canfd_frame kernel{};
  kernel.can_id = id;
  kernel.len = static_cast<std::uint8_t>(length);
  REQUIRE(send(fd, &kernel, size, 0) == static_cast<ssize_t>(size));
}

}  // namespace

TEST_CASE("frames of every kind pass between two buses unchanged and in order") {
  Pair pair;
  SocketCanBus one(std::move(pair.near), "one", writable());
  SocketCanBus two(std::move(pair.far), "two", writable());
  const auto frames = frames_of_every_kind();
  CHECK(one.write(frames) == frames.size());
  const auto read = read_frames(two, frames.size());
  REQUIRE(read.size() == frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) CHECK(read[i].same_on_wire(frames[i]));
  CHECK(one.counters().written == static_cast<std::int64_t>(frames.size()));
  CHECK(two.counters().read == static_cast<std::int64_t>(frames.size()));
  CHECK(two.counters().kernel_dropped == 0);
  std::array<CanFrame, 8> none;
  CHECK(two.read(none) == 0);
  CHECK(one.read(none) == 0);  // its own frames do not come back
}

TEST_CASE("a waiting read takes what comes meanwhile, and comes back when nothing does") {
  Pair pair;
  SocketCanBus one(std::move(pair.near), "one", writable());
  SocketCanBus two(std::move(pair.far), "two", {});
  std::array<CanFrame, 8> frames;
  CHECK(two.read_waiting(frames) == 0);
  std::thread writer([&] { one.write(std::array{numbered_frame(1), numbered_frame(2)}); });
  std::vector<std::uint32_t> numbers;
  for (int reads = 0; numbers.size() < 2 && reads < 1000; ++reads) {
    const std::size_t count = two.read_waiting(frames);
    for (std::size_t i = 0; i < count; ++i) numbers.push_back(number_of(frames[i]));
  }
  writer.join();
  CHECK(numbers == std::vector<std::uint32_t>{1, 2});
  CHECK(two.read(frames) == 0);
}

TEST_CASE("who waits in reads is not woken twice, and the descriptor tells again afterwards") {
  Pair pair;
  auto partner = std::make_unique<SocketCanBus>(std::move(pair.near), "one", writable());
  SocketCanBus& one = *partner;
  SocketCanBus two(std::move(pair.far), "two", {});
  const auto tells = [&two] {
    pollfd wake{two.file_descriptor(), POLLIN, 0};
    return poll(&wake, 1, 0) == 1;
  };
  std::array<CanFrame, 8> frames;
  const auto wait_for_one = [&] {
    one.write(std::array{numbered_frame(1)});
    REQUIRE(two.read_waiting(frames) >= 1);
    one.write(std::array{numbered_frame(2)});
    CHECK_FALSE(tells());  // the next wait takes it
  };
  wait_for_one();
  REQUIRE(two.read(frames) >= 1);  // ends the waiting
  one.write(std::array{numbered_frame(3)});
  CHECK(tells());
  wait_for_one();
  while (two.read_waiting(frames) > 0) continue;  // one that came back with nothing ends it too
  one.write(std::array{numbered_frame(4)});
  CHECK(tells());
  // The other end may go while the descriptor is out.
  wait_for_one();
  partner.reset();
  while (two.read_waiting(frames) > 0) continue;
  CHECK(two.at_end());
  CHECK_FALSE(tells());
}

TEST_CASE("more frames than a batch, and than the queue, keep their order") {
  Pair pair;
  SocketCanBus one(std::move(pair.near), "one", writable());
  SocketCanBus two(std::move(pair.far), "two", {});
  constexpr std::uint32_t kNum = 5000;
  std::vector<CanFrame> frames;
  for (std::uint32_t i = 0; i < kNum; ++i) frames.push_back(numbered_frame(i));
  // The writer has to wait for the reader: the socket's queue is shorter than this.
  std::thread writer([&] { one.write(frames); });
  const auto read = read_frames(two, kNum);
  writer.join();
  REQUIRE(read.size() == kNum);
  for (std::uint32_t i = 0; i < kNum; ++i) {
    if (number_of(read[i]) != i) FAIL("frame " << number_of(read[i]) << " at place " << i);
  }
  CHECK(one.counters().write_dropped == 0);
}

TEST_CASE("a read takes no more than was asked for and keeps the rest") {
  Pair pair;
  SocketCanBus one(std::move(pair.near), "one", writable());
  SocketCanBus two(std::move(pair.far), "two", {});
  std::vector<CanFrame> frames;
  for (std::uint32_t i = 0; i < 100; ++i) frames.push_back(numbered_frame(i));
  REQUIRE(one.write(frames) == 100);
  std::vector<CanFrame> read(100);
  CHECK(two.read(std::span(read).first(1)) == 1);
  CHECK(two.read(std::span(read).subspan(1, 70)) == 70);
  CHECK(two.read(std::span(read).subspan(71)) == 29);
  for (std::uint32_t i = 0; i < 100; ++i) CHECK(number_of(read[i]) == i);
}

TEST_CASE("a queue that stays full costs the time-out once, then frames, which are counted") {
  Pair pair;
  SocketCanBus one(std::move(pair.near), "one", writable(0.05));
  std::vector<CanFrame> frames(5000, numbered_frame(1));
  const std::int64_t start_ns = monotonic_time_ns();
  const std::size_t written = one.write(frames);  // nobody reads
  const double seconds = static_cast<double>(monotonic_time_ns() - start_ns) * 1e-9;
  CHECK(written > 0);
  CHECK(written < frames.size());
  CHECK(one.counters().written == static_cast<std::int64_t>(written));
  CHECK(one.counters().write_dropped == static_cast<std::int64_t>(frames.size() - written));
  CHECK(seconds >= 0.05);
  CHECK(seconds < 2.0);  // 79 batches, each waiting anew, would take 4 s
}

TEST_CASE("a read-only bus does not write") {
  Pair pair;
  SocketCanBus bus(std::move(pair.near), "one", {});
  const CanFrame frame = numbered_frame(1);
  CHECK_THROWS_AS(bus.write(std::span(&frame, 1)), std::logic_error);
}

TEST_CASE("frames that no bus carries are not sent, and cost no other frame") {
  Pair pair;
  SocketCanBus one(std::move(pair.near), "one", writable());
  SocketCanBus two(std::move(pair.far), "two", {});
  std::vector<CanFrame> frames = {numbered_frame(0), numbered_frame(1), numbered_frame(2)};
  frames[1].num_bytes = 9;
  CHECK(one.write(frames) == 2);
  frames[1].num_bytes = 8;
  frames[1].flags = CanFrame::kError;
  CHECK(one.write(frames) == 2);
  CHECK(one.counters().write_dropped == 2);
  const auto read = read_frames(two, 4);
  REQUIRE(read.size() == 4);
  CHECK(number_of(read[1]) == 2);
}

TEST_CASE("error frames are counted and told, never handed out, and bus-off stops the writing") {
  Pair pair;
  std::vector<std::string> events;
  BusOptions options = writable();
  options.on_event = [&](const std::string& event) { events.push_back(event); };
  SocketCanBus bus(std::move(pair.near), "can7", options);
  std::array<CanFrame, 8> frames;
  const CanFrame frame = numbered_frame(1);

  for (int i = 0; i < 3; ++i) send_raw(pair.far.get(), CAN_ERR_FLAG | CAN_ERR_BUSERROR, 8, 16);
  CHECK(bus.read(frames) == 0);
  CHECK(events.empty());
  send_raw(pair.far.get(), CAN_ERR_FLAG | CAN_ERR_BUSOFF, 8, 16);
  send_raw(pair.far.get(), CAN_ERR_FLAG | CAN_ERR_BUSOFF, 8, 16);
  send_raw(pair.far.get(), 0x11, 0, 16);
  CHECK(bus.read(frames) == 1);
  CHECK(frames[0].identifier == 0x11);
  CHECK(events == std::vector<std::string>{"can7: bus-off"});
  CHECK(bus.write(std::span(&frame, 1)) == 0);
  CHECK(bus.counters().write_dropped == 1);
  send_raw(pair.far.get(), CAN_ERR_FLAG | CAN_ERR_RESTARTED, 8, 16);
  CHECK(bus.read(frames) == 0);
  CHECK(events.back() == "can7: restarted");
  CHECK(bus.write(std::span(&frame, 1)) == 1);
  CHECK(bus.counters().error_frames == 6);
}

TEST_CASE("malformed datagrams are refused and counted") {
  Pair pair;
  SocketCanBus bus(std::move(pair.near), "one", {});
  std::array<CanFrame, 8> frames;
  send_raw(pair.far.get(), 1, 9, 16);   // classic with nine bytes
  send_raw(pair.far.get(), 1, 11, 72);  // FD with eleven
  send_raw(pair.far.get(), 1, 0, 5);    // neither form
  const std::array<char, 200> too_long{};
  REQUIRE(send(pair.far.get(), too_long.data(), too_long.size(), 0) == 200);
  send_raw(pair.far.get(), 0x1801, 0, 16);
  CHECK(bus.read(frames) == 1);
  CHECK(frames[0].identifier == 1);
  CHECK(bus.counters().refused == 4);
}

TEST_CASE("a closed other end is the end") {
  Pair pair;
  SocketCanBus bus(std::move(pair.near), "one", writable());
  send_raw(pair.far.get(), 1, 0, 16);
  pair.far = FileDescriptor();
  std::array<CanFrame, 8> frames;
  CHECK(bus.read(frames) == 1);
  CHECK(bus.read(frames) == 0);
  CHECK(bus.at_end());
  pollfd state{bus.file_descriptor(), POLLIN, 0};
  CHECK(poll(&state, 1, 0) == 0);  // and keeps nobody awake
  const CanFrame frame = numbered_frame(1);
  CHECK(bus.write(std::span(&frame, 1)) == 0);
}

TEST_CASE("a drop counter adds up from two sources and over the wrap") {
  DropCounter drops;
  drops.note(5);
  drops.note(3);  // an older reading
  drops.note(7);
  CHECK(drops.total() == 7);
  DropCounter wrapping;
  for (const std::uint32_t count : {0x7FFFFFFFU, 0xFFFFFFF0U, 0x10U}) wrapping.note(count);
  CHECK(wrapping.total() == 0x100000010);
}
