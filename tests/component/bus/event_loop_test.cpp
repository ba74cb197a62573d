#include "drivers/event_loop.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include <csignal>
#include <stdexcept>

#include "common/errors.h"
#include "drivers/can/loop_bus.h"
#include "drivers/file_descriptor.h"
#include "tests/support/bus_reading.h"
#include "tests/support/catch.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

// A loop that does not end by itself fails its test instead of hanging it.
struct GuardedLoop : EventLoop {
  GuardedLoop() {
    after(30.0, [] { throw std::runtime_error("the loop was not stopped in time"); });
  }
};

double seconds_since(std::int64_t start_ns) {
  return static_cast<double>(monotonic_time_ns() - start_ns) * 1e-9;
}

}  // namespace

TEST_CASE("a watch calls while there is something to read, and its owner keeps the descriptor") {
  GuardedLoop loop;
  const FileDescriptor event(eventfd(3, EFD_NONBLOCK | EFD_SEMAPHORE));
  int num_calls = 0;
  {
    loop.watch(event.get(), [&] {
      eventfd_t one = 0;
      REQUIRE(eventfd_read(event.get(), &one) == 0);
      if (++num_calls == 3) loop.stop();
    });
    loop.run();
  }
  CHECK(num_calls == 3);
  CHECK(eventfd_write(event.get(), 1) == 0);  // still open
}

TEST_CASE("what a callback leaves unread calls it again") {
  GuardedLoop loop;
  const FileDescriptor event(eventfd(1, EFD_NONBLOCK));
  int num_calls = 0;
  loop.watch(event.get(), [&] {
    if (++num_calls == 5) loop.stop();
  });
  loop.run();
  CHECK(num_calls == 5);
}

TEST_CASE("a stopped watch calls no more, stopped from inside or outside its callback") {
  GuardedLoop loop;
  const FileDescriptor event(eventfd(1, EFD_NONBLOCK));
  int num_inside = 0, num_outside = 0, num_ticks = 0;
  EventLoop::Watch inside, outside, ticks;
  inside = loop.watch(event.get(), [&] {
    ++num_inside;
    inside.stop();
  });
  outside = loop.watch(event.get(), [&] { ++num_outside; });
  outside.stop();
  ticks = loop.every(0.001, [&] {
    if (++num_ticks == 5) ticks.stop();
  });
  loop.after(0.05, [&] { loop.stop(); });
  loop.run();
  CHECK(num_inside == 1);
  CHECK(num_outside == 0);
  CHECK(num_ticks == 5);
}

TEST_CASE("a hung-up descriptor does not spin") {
  GuardedLoop loop;
  int ends[2];
  REQUIRE(pipe(ends) == 0);
  const FileDescriptor read_end(ends[0]);
  close(ends[1]);
  int num_calls = 0;
  loop.watch(read_end.get(), [&] { ++num_calls; });
  loop.after(0.3, [&] { loop.stop(); });
  loop.run();
  CHECK(num_calls >= 1);
  CHECK(num_calls <= 7);  // one at once and one each 50 ms; a spin makes thousands
}

TEST_CASE("timers keep to multiples of their period") {
  GuardedLoop loop;
  const std::int64_t start_ns = monotonic_time_ns();
  int num_ticks = 0;
  loop.every(0.01, [&] {
    ++num_ticks;
    CHECK(seconds_since(start_ns) >= 0.01 * num_ticks - 1e-6);  // never early
    if (num_ticks == 20) loop.stop();
  });
  loop.run();
  CHECK(num_ticks == 20);
  CHECK_THROWS_AS(loop.every(0.0, [] {}), UsageError);
}

TEST_CASE("what a callback throws comes out of run") {
  GuardedLoop loop;
  loop.after(0.0, [] { throw std::domain_error("from a callback"); });
  CHECK_THROWS_AS(loop.run(), std::domain_error);
}

TEST_CASE("stop before run is not forgotten, and the loop can run once more") {
  GuardedLoop loop;
  loop.stop();
  loop.run();
  bool has_run = false;
  loop.after(0.0, [&] {
    has_run = true;
    loop.stop();
  });
  loop.run();
  CHECK(has_run);
}

TEST_CASE("a stop signal is a callback") {
  GuardedLoop loop;
  int num_signals = 0;
  loop.on_stop_signal([&] {
    if (++num_signals == 2) loop.stop();
    if (num_signals == 1) REQUIRE(raise(SIGTERM) == 0);
  });
  loop.after(0.0, [] { REQUIRE(raise(SIGINT) == 0); });
  loop.run();
  CHECK(num_signals == 2);
}

TEST_CASE("a descriptor that is none is refused") {
  EventLoop loop;
  CHECK_THROWS_AS(loop.watch(-1, [] {}), JobError);
}

TEST_CASE("a bus is followed when its descriptor changes") {
  // Hands out another descriptor after each read, as a bus does that had to open itself anew.
  struct ChangingBus : CanBus {
    int file_descriptor() const override { return events[current].get(); }
    std::size_t read(std::span<CanFrame>) override {
      current = 1 - current;
      return 0;
    }
    std::size_t write(std::span<const CanFrame>) override { return 0; }
    const BusCounters& counters() override { return none; }
    std::array<FileDescriptor, 2> events = {FileDescriptor(eventfd(1, EFD_NONBLOCK)),
                                            FileDescriptor(eventfd(1, EFD_NONBLOCK))};
    std::size_t current = 0;
    BusCounters none;
  };
  GuardedLoop loop;
  ChangingBus bus;
  int num_calls = 0;
  loop.watch_bus(bus, [&] {
    bus.read({});
    if (++num_calls == 4) loop.stop();
  });
  loop.run();
  CHECK(num_calls == 4);
}

TEST_CASE("a loop bus wakes the event loop") {
  GuardedLoop loop;
  auto [one, two] = make_loop_pair();
  std::vector<std::uint32_t> numbers;
  loop.watch_bus(*two, [&, &bus = *two] {
    std::array<CanFrame, 2> batch;
    const std::size_t count = bus.read(batch);
    for (std::size_t i = 0; i < count; ++i) numbers.push_back(number_of(batch[i]));
    if (numbers.size() == 3) loop.stop();
  });
  const std::array<CanFrame, 3> frames = {numbered_frame(4), numbered_frame(5), numbered_frame(6)};
  loop.after(0.0, [&, &bus = *one] { bus.write(frames); });
  loop.run();
  CHECK(numbers == std::vector<std::uint32_t>{4, 5, 6});
}
