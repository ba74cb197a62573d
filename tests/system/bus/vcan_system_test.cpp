// SocketCAN on a real kernel, against can-utils. Needs vcan0 and vcan1 (scripts/with-vcan).

#include <atomic>
#include <fstream>
#include <thread>
#include <utility>

#include "common/errors.h"
#include "drivers/can/can_bus.h"
#include "drivers/can/candump_log.h"
#include "drivers/can/ring_exchange.h"
#include "drivers/can/socketcan_bus.h"
#include "drivers/event_loop.h"
#include "tests/support/bus_reading.h"
#include "tests/support/catch.h"
#include "tests/support/child_process.h"
#include "tests/support/temporary_folder.h"

using namespace holdfast;
using namespace holdfast::testing;
using Catch::Matchers::Contains;
using Events = std::vector<std::string>;

namespace {

BusOptions writable_telling(Events* events = nullptr) {
  BusOptions options = writable();
  if (events != nullptr)
    options.on_event = [events](const std::string& event) { events->push_back(event); };
  return options;
}

std::unique_ptr<CanBus> open_vcan(int number, Events* events = nullptr) {
  return open_can_bus("socketcan:vcan" + std::to_string(number), writable_telling(events));
}

bool ip(const std::string& arguments) {
  return run_command({"sh", "-c", "ip " + arguments}) == 0;
}

// Sockets that listen to all frames of an interface, as the kernel lists them.
int count_listeners(const std::string& interface_name) {
  std::ifstream list("/proc/net/can/rcvlist_all");
  int count = 0;
  for (std::string line; std::getline(list, line);) {
    if (line.find(" " + interface_name + " ") != std::string::npos) ++count;
  }
  return count;
}

// candump that listens already.
std::unique_ptr<ChildProcess> start_candump(const std::string& interface_name, std::size_t num) {
  const int before = count_listeners(interface_name);
  auto candump = std::make_unique<ChildProcess>(
      std::vector<std::string>{"candump", "-L", "-n", std::to_string(num), interface_name});
  const std::int64_t end_ns = monotonic_time_ns() + 20'000'000'000;
  while (count_listeners(interface_name) <= before) {
    REQUIRE(monotonic_time_ns() < end_ns);
    std::this_thread::yield();
  }
  return candump;
}

void check_equal(const std::vector<CanFrame>& read, const std::vector<CanFrame>& expected) {
  REQUIRE(read.size() == expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    INFO("frame " << i);
    CHECK(read[i].same_on_wire(expected[i]));
  }
}

void no_frame(const CanFrame&) {
  FAIL("a frame that nobody sent");
}

}  // namespace

TEST_CASE("candump sees our frames as we sent them") {
  const auto bus = open_vcan(0);
  const auto frames = frames_of_every_kind();
  const auto candump = start_candump("vcan0", frames.size());
  REQUIRE(bus->write(frames) == frames.size());
  std::vector<CanFrame> seen;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    CandumpRecord record;
    const std::string line = candump->read_line();
    INFO(line);
    REQUIRE(parse_candump_line(line, record) == CandumpLine::kFrame);
    seen.push_back(record.frame);
  }
  CHECK(candump->wait() == 0);
  check_equal(seen, frames);
}

TEST_CASE("we see what cansend sends, with the kernel's receive time") {
  const auto bus = open_vcan(0);
  const std::int64_t before_ns = (wall_utime() - 1) * 1000;
  for (const char* frame :
       {"123#DEADBEEF", "00000123#11", "05A#R", "12345678#R4", "7FF#", "321##1AABBCC"}) {
    REQUIRE(run_command({"cansend", "vcan0", frame}) == 0);
  }
  const auto frames = read_frames(*bus, 6);
  REQUIRE(frames.size() == 6);
  CandumpRecord record;
  record.interface_name = "vcan0";
  const char* const expected[] = {"123#DEADBEEF", "00000123#11", "05A#R",
                                  "12345678#R4",  "7FF#",        "321##1AABBCC"};
  for (std::size_t i = 0; i < 6; ++i) {
    record.frame = frames[i];
    CHECK_THAT(format_candump_line(record), Contains(expected[i]));
    CHECK(frames[i].receive_time_ns >= before_ns);
    CHECK(frames[i].receive_time_ns <= (wall_utime() + 1) * 1000);
  }
}

TEST_CASE("a bus for writing only is not sent the others' frames") {
  BusOptions options = writable();
  options.wants_frames = false;
  const auto quiet = open_can_bus("socketcan:vcan0", options), other = open_vcan(0);
  const CanFrame first = numbered_frame(1), second = numbered_frame(2);
  REQUIRE(other->write(std::span(&first, 1)) == 1);
  REQUIRE(quiet->write(std::span(&second, 1)) == 1);
  check_equal(read_frames(*other, 1), {second});  // by now the first would have arrived
  std::array<CanFrame, 4> none;
  CHECK(quiet->read(none) == 0);
}

TEST_CASE("canplayer plays a log that we wrote, and the bus reads it back") {
  const TemporaryFolder folder;
  const std::string file = folder.file("frames.log");
  const auto frames = frames_of_every_kind();
  open_can_bus("candump-write:" + file, writable())->write(frames);
  const auto bus = open_vcan(0);
  REQUIRE(run_command({"canplayer", "-t", "-g", "0", "-I", file}) == 0);
  check_equal(read_frames(*bus, frames.size()), frames);
}

TEST_CASE(
    "a bus hears other sockets and the other direction, never itself, and vcan1 is another bus") {
  const auto one = open_vcan(0), two = open_vcan(0), apart = open_vcan(1);
  const CanFrame first = numbered_frame(1), second = numbered_frame(2);
  REQUIRE(one->write(std::span(&first, 1)) == 1);
  REQUIRE(two->write(std::span(&second, 1)) == 1);
  check_equal(read_frames(*one, 1), {second});
  check_equal(read_frames(*two, 1), {first});
  std::array<CanFrame, 4> none;
  CHECK(one->read(none) == 0);
  CHECK(apart->read(none) == 0);
}

TEST_CASE("what the kernel dropped is counted, though no frame came after it") {
  Events events;
  BusOptions small = writable_telling(&events);
  small.receive_buffer_bytes = 16384;
  const auto reader = open_can_bus("socketcan:vcan0", small);
  const auto writer = open_vcan(0), roomy = open_vcan(0);
  constexpr std::size_t kNum = 3000;
  const std::vector<CanFrame> frames(kNum, numbered_frame(1));
  REQUIRE(writer->write(frames) == kNum);
  std::vector<CanFrame> read(kNum);
  const std::size_t num_read = reader->read(read);
  CHECK(num_read > 0);
  CHECK(num_read < kNum);
  CHECK(num_read + static_cast<std::size_t>(reader->counters().kernel_dropped) == kNum);
  CHECK(events.size() == 1);
  // The default buffer holds them all; one more frame brings the count a second way, and adds
  // nothing.
  CHECK(roomy->read(read) == kNum);
  CHECK(roomy->counters().kernel_dropped == 0);
  REQUIRE(writer->write(std::span(frames).first(1)) == 1);
  CHECK(reader->read(read) == 1);
  CHECK(num_read + static_cast<std::size_t>(reader->counters().kernel_dropped) == kNum);
}

TEST_CASE("an interface that goes down and up again is waited for, without spinning") {
  Events events;
  const auto bus = open_vcan(0, &events), other = open_vcan(0);
  REQUIRE(ip("link set vcan0 down"));
  CHECK(read_until(
      *bus, [&] { return events.size() == 1; }, no_frame));
  {
    EventLoop loop;
    int num_wakes = 0;
    loop.watch_bus(*bus, [&] {
      ++num_wakes;
      std::array<CanFrame, 4> none;
      bus->read(none);
    });
    loop.after(0.3, [&] { loop.stop(); });
    loop.run();
    CHECK(num_wakes < 10);
  }
  REQUIRE(ip("link set vcan0 up"));
  CHECK(read_until(
      *bus, [&] { return events.size() == 2; }, no_frame));
  CHECK(events == Events{"vcan0 is down: waiting", "vcan0 is up again"});
  CHECK(bus->counters().times_down == 1);
  const CanFrame frame = numbered_frame(9);
  REQUIRE(other->write(std::span(&frame, 1)) == 1);
  check_equal(read_frames(*bus, 1), {frame});
}

TEST_CASE("an interface that was deleted and made again is bound anew, descriptor unchanged") {
  Events events;
  const auto bus = open_vcan(1, &events);
  const int descriptor = bus->file_descriptor();
  REQUIRE(ip("link del vcan1"));
  CHECK(read_until(
      *bus, [&] { return events.size() == 1; }, no_frame));
  REQUIRE(ip("link add vcan1 type vcan && ip link set vcan1 mtu 72 up"));
  CHECK(read_until(
      *bus, [&] { return events.back() == "vcan1 is up again"; }, no_frame));
  CHECK(events.front() == "vcan1 is gone: waiting");
  CHECK(bus->counters().times_down == 1);
  CHECK(bus->file_descriptor() == descriptor);
  const auto other = open_vcan(1);
  const auto frames = frames_of_every_kind();
  REQUIRE(other->write(frames) == frames.size());
  check_equal(read_frames(*bus, frames.size()), frames);
  REQUIRE(bus->write(frames) == frames.size());
  check_equal(read_frames(*other, frames.size()), frames);
}

TEST_CASE("a write waits for an interface that is down, up to its time-out") {
  const auto other = open_vcan(0);
  const CanFrame frame = numbered_frame(3);
  std::atomic<int> num_events = 0;
  BusOptions options = writable();
  options.on_event = [&](const std::string&) { ++num_events; };
  options.write_timeout_s = 20.0;
  const auto patient = open_can_bus("socketcan:vcan0", options);
  options.write_timeout_s = 0.05;
  options.on_event = nullptr;
  const auto hasty = open_can_bus("socketcan:vcan0", options);
  REQUIRE(ip("link set vcan0 down"));

  CHECK(hasty->write(std::span(&frame, 1)) == 0);
  CHECK(hasty->counters().write_dropped == 1);

  std::size_t num_written = 0;
  std::thread writer([&] { num_written = patient->write(std::span(&frame, 1)); });
  const std::int64_t end_ns = monotonic_time_ns() + 15'000'000'000;
  while (num_events == 0 && monotonic_time_ns() < end_ns) std::this_thread::yield();
  CHECK(num_events == 1);  // it met the interface down
  CHECK(ip("link set vcan0 up"));
  writer.join();
  CHECK(num_written == 1);
  CHECK(patient->counters().write_dropped == 0);
  check_equal(read_frames(*other, 1), {frame});
}

TEST_CASE("FD frames do not go onto a classic interface") {
  REQUIRE(ip("link set vcan1 down && ip link set vcan1 mtu 16 up"));
  Events events;
  const auto bus = open_vcan(1, &events), other = open_vcan(1);
  const auto frames = frames_of_every_kind();
  std::vector<CanFrame> classic;
  for (const CanFrame& frame : frames) {
    if (!frame.has(CanFrame::kFd)) classic.push_back(frame);
  }
  CHECK(bus->write(frames) == classic.size());
  CHECK(bus->counters().write_dropped == static_cast<std::int64_t>(frames.size() - classic.size()));
  check_equal(read_frames(*other, classic.size()), classic);
  REQUIRE(events.size() == 1);  // told once, with the remedy
  CHECK_THAT(events[0], Contains("ip link set vcan1 mtu 72"));
  // The bus learns that the interface was changed.
  REQUIRE(ip("link set vcan1 down && ip link set vcan1 mtu 72 up"));
  CHECK(read_until(
      *bus, [&] { return events.back() == "vcan1 is up again"; }, no_frame));
  CHECK(bus->write(frames) == frames.size());
}

TEST_CASE("hardware is not written to without the user's word") {
  // Loopback stands for any interface that is not virtual CAN.
  CHECK_THROWS_WITH(open_can_bus("socketcan:lo", writable()),
                    Contains("--i-own-this-bus socketcan:lo"));
  BusOptions owned = writable();
  owned.owned_urls = {"socketcan:lo"};
  CHECK_THROWS_AS(open_can_bus("socketcan:lo", owned),
                  JobError);  // past the check: no CAN interface
  CHECK_THROWS_AS(open_can_bus("socketcan:vcan77", writable()), JobError);
  CHECK(is_virtual_can("vcan0"));
  CHECK_FALSE(is_virtual_can("lo"));
  REQUIRE(ip("link add vx0 type vxcan peer name vx1"));
  CHECK(is_virtual_can("vx0"));
  CHECK(ip("link del vx0"));
}

TEST_CASE("frames are handed from interface to interface, though either is down for a while") {
  Events events;
  std::atomic<bool> is_down = false;
  BusOptions options = writable();
  options.wants_receive_times = false;
  options.on_event = [&](const std::string& event) {
    events.push_back(event);
    is_down = is_down || event == "vcan1 is down: waiting";
  };
  const auto from = open_can_bus("socketcan:vcan0", options);
  const auto to = open_can_bus("socketcan:vcan1", options);
  const auto source = open_vcan(0), sink = open_vcan(1);
  std::array<CanFrame, 8> frames;
  std::size_t count = 0;
  const auto hand_over = [&](std::uint32_t number) {
    const CanFrame frame = numbered_frame(number);
    REQUIRE(source->write(std::span(&frame, 1)) == 1);
    const auto held = std::span(frames).first(count);
    count = from->hand_over(*to, held, frames);
    // A frame may come right after a call that came back for another reason.
    for (int i = 0; count == 0 && i < 100; ++i) count = from->hand_over(*to, {}, frames);
    REQUIRE(count == 1);
    CHECK(number_of(frames[0]) == number);
  };
  for (std::uint32_t i = 0; i < 5; ++i) hand_over(i);

  REQUIRE(ip("link set vcan1 down"));
  {
    const std::int64_t end_ns = monotonic_time_ns() + 15'000'000'000;
    const std::jthread restorer([&] {
      while (!is_down && monotonic_time_ns() < end_ns) std::this_thread::yield();
      ip("link set vcan1 up");
    });
    hand_over(5);  // frame 4 waits until its interface is up
  }
  CHECK(to->counters().times_down == 1);
  hand_over(6);
  const bool has_ring = RingExchange::open(1.0) != nullptr;
  CHECK((dynamic_cast<SocketCanBus&>(*from).num_exchanged() > 0) == has_ring);

  REQUIRE(ip("link set vcan0 down"));
  to->write(std::span(frames).first(std::exchange(count, 0)));
  for (int i = 0; i < 1000 && from->counters().times_down == 0; ++i)
    CHECK(from->hand_over(*to, {}, frames) == 0);
  CHECK(from->counters().times_down == 1);
  REQUIRE(ip("link set vcan0 up"));
  CHECK(read_until(
      *from, [&] { return events.back() == "vcan0 is up again"; }, no_frame));
  for (std::uint32_t i = 7; i < 12; ++i) hand_over(i);
  to->write(std::span(frames).first(count));
  const auto arrived = read_frames(*sink, 12);
  REQUIRE(arrived.size() == 12);
  for (std::uint32_t i = 0; i < 12; ++i) CHECK(number_of(arrived[i]) == i);
  CHECK(to->counters().written == 12);
  CHECK(to->counters().write_dropped == 0);
}
