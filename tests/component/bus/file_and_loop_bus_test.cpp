#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "common/errors.h"
#include "drivers/can/candump_bus.h"
#include "drivers/can/loop_bus.h"
#include "drivers/event_loop.h"
#include "tests/support/bus_reading.h"
#include "tests/support/catch.h"
#include "tests/support/temporary_folder.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

std::vector<CanFrame> read_all(CanBus& bus) {
  std::vector<CanFrame> frames;
  std::array<CanFrame, 3> batch;
  while (!bus.at_end()) {
    const std::size_t count = bus.read(batch);
    frames.insert(frames.end(), batch.begin(), batch.begin() + static_cast<std::ptrdiff_t>(count));
  }
  return frames;
}

}  // namespace

TEST_CASE("a log is read back as it was written") {
  const TemporaryFolder folder;
  const std::string file = folder.file("frames.log");
  auto frames = frames_of_every_kind();
  for (std::size_t i = 0; i < frames.size(); ++i) {
    frames[i].receive_time_ns = static_cast<std::int64_t>(i + 1) * 1'000'001'000;
  }
  {
    const auto log = open_can_bus("candump-write:" + file, writable());
    CHECK(log->write(frames) == frames.size());
    CHECK(log->counters().written == static_cast<std::int64_t>(frames.size()));
  }
  const auto log = open_can_bus("candump:" + file);
  CHECK(log->file_descriptor() == -1);
  const auto read = read_all(*log);
  REQUIRE(read.size() == frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    CHECK(read[i].same_on_wire(frames[i]));
    CHECK(read[i].receive_time_ns == frames[i].receive_time_ns);
  }
  CHECK_THROWS_AS(open_can_bus("candump-write:" + file, writable()), UsageError);  // is there
  CHECK_THROWS_AS(open_can_bus("candump:" + file, writable()), UsageError);
  CHECK_THROWS_AS(log->write(frames), std::logic_error);
}

TEST_CASE("comments, broken lines and error frames of a log are told apart") {
  const TemporaryFolder folder;
  const std::string file = folder.file("mixed.log");
  std::ofstream(file)
      << "DROPCOUNT: dropped 1 CAN frames\n(1.000000) can0 123#01\n(1.5) can0 123#\n"
      << "(1.000000) can0 20000040#0000000000000000\n\n(2.000000) can1 124#02";
  CandumpReader log(file);
  const auto frames = read_all(log);
  REQUIRE(frames.size() == 2);
  CHECK(frames[1].identifier == 0x124);  // the last line has no line end
  CHECK(log.counters().refused == 1);
  CHECK(log.counters().error_frames == 1);
  CHECK(log.counters().read == 2);
}

TEST_CASE("the event loop plays a log to its end and lets other work in between") {
  const TemporaryFolder folder;
  const std::string file = folder.file("frames.log");
  const auto frames = frames_of_every_kind();
  CandumpWriter(file, writable()).write(frames);
  CandumpReader log(file);
  EventLoop loop;
  std::size_t num_read = 0, read_at_timer = 0;
  loop.watch_bus(log, [&] {
    CanFrame frame;
    num_read += log.read(std::span(&frame, 1));
  });
  loop.after(0.0, [&] { read_at_timer = num_read; });
  loop.run();  // ends by itself
  CHECK(num_read == frames.size());
  CHECK(read_at_timer < frames.size());
}

TEST_CASE("a folder is no log") {
  const TemporaryFolder folder;
  CHECK_THROWS_AS(CandumpReader(folder.file(".")), UsageError);
}

TEST_CASE("all but the writer read a loop bus, in order") {
  const auto medium = std::make_shared<LoopMedium>();
  LoopBus one(medium, writable()), two(medium, writable()), three(medium);
  const auto frames = frames_of_every_kind();
  CHECK(one.write(frames) == frames.size());
  for (LoopBus* bus : {&two, &three}) {
    const auto read = read_frames(*bus, frames.size());
    REQUIRE(read.size() == frames.size());
    for (std::size_t i = 0; i < frames.size(); ++i) CHECK(read[i].same_on_wire(frames[i]));
    CHECK(read[0].receive_time_ns > 0);
  }
  std::array<CanFrame, 4> none;
  CHECK(one.read(none) == 0);
  CHECK_THROWS_AS(three.write(frames), std::logic_error);
}

TEST_CASE("a loop bus that nobody reads loses the newest frames and counts them") {
  auto [one, two] = make_loop_pair();
  const std::vector<CanFrame> frames(LoopBus::kQueueMax + 5, numbered_frame(1));
  CHECK(one->write(frames) == frames.size());
  CHECK(two->counters().kernel_dropped == 5);
}

TEST_CASE("loop: by URL is a medium of its own") {
  const auto one = open_can_bus("loop:a", writable());
  const auto two = open_can_bus("loop:a", writable());
  const CanFrame frame = numbered_frame(1);
  CHECK(one->write(std::span(&frame, 1)) == 1);
  std::array<CanFrame, 4> none;
  CHECK(two->read(none) == 0);
}
