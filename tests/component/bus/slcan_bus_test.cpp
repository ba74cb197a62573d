// The SLCAN host over a pair of pseudo-terminals, whose other end stands for the adapter.
#include "drivers/can/slcan_bus.h"

#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <filesystem>

#include "common/errors.h"
#include "drivers/event_loop.h"
#include "tests/support/catch.h"
#include "tests/support/temporary_folder.h"

namespace holdfast {
namespace {

// The adapter's end, reachable under a name that outlives it.
class Adapter {
 public:
  explicit Adapter(const std::string& name)
      : master_(posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK)) {
    REQUIRE(master_.is_open());
    REQUIRE(grantpt(master_.get()) == 0);
    REQUIRE(unlockpt(master_.get()) == 0);
    std::array<char, 128> path{};
    REQUIRE(ptsname_r(master_.get(), path.data(), path.size()) == 0);
    std::filesystem::remove(name);
    std::filesystem::create_symlink(path.data(), name);
  }

  void say(const std::string& text) {
    REQUIRE(::write(master_.get(), text.data(), text.size()) == static_cast<ssize_t>(text.size()));
  }
  // What has been heard; waits until that ends with the text.
  std::string hear(const std::string& end) {
    std::string heard;
    while (!heard.ends_with(end)) {
      pollfd readable{master_.get(), POLLIN, 0};
      if (poll(&readable, 1, 2000) <= 0) break;
      std::array<char, 256> bytes;
      const ssize_t count = ::read(master_.get(), bytes.data(), bytes.size());
      if (count <= 0) break;
      heard.append(bytes.data(), static_cast<std::size_t>(count));
    }
    return heard;
  }

 private:
  FileDescriptor master_;
};

class Bench {
 public:
  explicit Bench(bool may_write = true) : adapter_(std::make_unique<Adapter>(device())) {
    BusOptions options;
    options.may_write = may_write;
    options.owned_urls = {url()};
    options.write_timeout_s = 0.2;
    options.on_event = [this](const std::string& event) { events_.push_back(event); };
    bus_ = std::make_unique<SlcanBus>(url(), options);
  }

  std::string device() const { return folder_.file("adapter"); }
  std::string url() const { return "slcan:" + device(); }
  Adapter& adapter() { return *adapter_; }
  SlcanBus& bus() { return *bus_; }
  void pull_out() { adapter_.reset(); }
  void plug_in() { adapter_ = std::make_unique<Adapter>(device()); }

  // Frames that come until as many as wanted have, or two seconds are over; by the bus's own
  // descriptor.
  std::vector<CanFrame> frames(std::size_t wanted) {
    std::vector<CanFrame> frames;
    std::array<CanFrame, 16> batch;
    for (;;) {
      const std::size_t count = bus_->read(batch);
      frames.insert(frames.end(), batch.begin(),
                    batch.begin() + static_cast<std::ptrdiff_t>(count));
      if (frames.size() >= wanted) return frames;
      pollfd readable{bus_->file_descriptor(), POLLIN, 0};
      if (poll(&readable, 1, 2000) <= 0) return frames;
    }
  }
  // Turns the bus until the event is told.
  bool is_told(const std::string& part) {
    for (int i = 0; i < 100; ++i) {
      frames(0);
      for (const std::string& event : events_) {
        if (event.find(part) != std::string::npos) return true;
      }
      pollfd readable{bus_->file_descriptor(), POLLIN, 0};
      poll(&readable, 1, 50);
    }
    return false;
  }

 private:
  testing::TemporaryFolder folder_;
  std::unique_ptr<Adapter> adapter_;
  std::vector<std::string> events_;
  std::unique_ptr<SlcanBus> bus_;
};

CanFrame reading(std::uint8_t value) {
  CanFrame frame;
  frame.identifier = 0x101;
  frame.num_bytes = 1;
  frame.data[0] = value;
  return frame;
}

}  // namespace

TEST_CASE("an adapter is closed, told the bitrate, and opened as far as is needed") {
  Bench writer, reader(false);
  CHECK(writer.adapter().hear("O\r") == "C\rC\rS6\rO\r");
  CHECK(reader.adapter().hear("L\r") == "C\rC\rS6\rL\r");
  const std::array<CanFrame, 1> one = {reading(1)};
  CHECK_THROWS_AS(reader.bus().write(one), std::logic_error);
  BusOptions options;
  options.may_write = true;
  CHECK_THROWS_AS(SlcanBus(writer.url(), options), UsageError);
  options.may_write = false;
  CHECK_THROWS_AS(SlcanBus("slcan:/no/such/device", options), JobError);
  CHECK_THROWS_AS(SlcanBus("slcan:/dev/null", options), JobError);
}

TEST_CASE(
    "frames of an adapter are read in order, however they are split, with the time of the host") {
  Bench bench;
  bench.adapter().say("\r\r\rt10110");
  CHECK(bench.frames(1).empty());
  bench.adapter().say("1\rt101102\rT00000");
  bench.adapter().say("101103\rqqq\r");
  const std::vector<CanFrame> frames = bench.frames(3);
  REQUIRE(frames.size() == 3);
  CHECK(frames[0].same_on_wire(reading(1)));
  CHECK(frames[1].same_on_wire(reading(2)));
  CHECK(frames[2].has(CanFrame::kExtended));
  CHECK(frames[2].receive_time_ns > 1'600'000'000'000'000'000);
  CHECK(bench.bus().counters().read == 3);
  CHECK(bench.bus().counters().refused == 1);
}

TEST_CASE("an adapter that cannot only listen is opened all the same, and that is told") {
  Bench bench(false);
  CHECK(bench.adapter().hear("L\r").ends_with("L\r"));
  bench.adapter().say("\a\r\r\a");
  CHECK(bench.is_told("cannot be opened listen-only"));
  CHECK(bench.adapter().hear("O\r") == "O\r");
  bench.adapter().say("\a");
  CHECK(bench.is_told("refuses to be opened"));
  CHECK(bench.adapter().hear("O\r").empty());  // not again and again

  // One that was closed already refuses that alone.
  Bench closed(false);
  closed.adapter().hear("L\r");
  closed.adapter().say("\a\a\r\r");
  closed.adapter().say("t101101\r");
  CHECK(closed.frames(1).size() == 1);
  CHECK_FALSE(closed.is_told("listen-only"));
}

TEST_CASE("frames that came at once and were not all asked for are told of until they are read") {
  Bench bench;
  std::string text;
  for (int i = 0; i < 100; ++i) text += "t1011" + std::string(i % 2 == 0 ? "01" : "02") + "\r";
  bench.adapter().say(text);
  std::array<CanFrame, 16> batch;
  std::size_t num_read = 0;
  while (num_read < 100) {
    pollfd readable{bench.bus().file_descriptor(), POLLIN, 0};
    REQUIRE(poll(&readable, 1, 2000) == 1);
    const std::size_t count = bench.bus().read(batch);
    REQUIRE(count > 0);
    for (std::size_t i = 0; i < count; ++i)
      CHECK(batch[i].same_on_wire(reading((num_read + i) % 2 == 0 ? 1 : 2)));
    num_read += count;
  }
  CHECK(num_read == 100);
  pollfd readable{bench.bus().file_descriptor(), POLLIN, 0};
  CHECK(poll(&readable, 1, 50) == 0);
}

TEST_CASE("a line that was cut is ended before the next one") {
  Bench bench;
  bench.adapter().hear("O\r");
  // Nobody reads: the line's queue is full at some place within a frame.
  const std::vector<CanFrame> many(20000, reading(7));
  const std::size_t written = bench.bus().write(many);
  CHECK(written < many.size());
  CHECK(bench.bus().counters().write_dropped == static_cast<std::int64_t>(many.size() - written));
  std::string heard;
  for (std::string part = bench.adapter().hear("?"); !part.empty();
       part = bench.adapter().hear("?"))
    heard += part;
  const std::array<CanFrame, 1> one = {reading(9)};
  CHECK(bench.bus().write(one) == 1);
  heard += bench.adapter().hear("t101109\r");
  CHECK(heard.ends_with("\rt101109\r"));
  std::size_t num_whole = 0;
  SlcanReader reader;
  reader.take(heard, [&num_whole](SlcanLine kind, const CanFrame& frame, std::string_view) {
    if (kind == SlcanLine::kFrame && frame.same_on_wire(reading(7))) ++num_whole;
  });
  CHECK(num_whole == written);
}

TEST_CASE("an adapter that answers, and one that does not, get the same frames") {
  for (const bool answers : {true, false}) {
    Bench bench;
    bench.adapter().hear("O\r");
    if (answers) bench.adapter().say("\r\a\r\r");  // it was closed already
    const std::array<CanFrame, 3> frames = {reading(1), reading(2), reading(3)};
    CHECK(bench.bus().write(frames) == 3);
    CHECK(bench.adapter().hear("t101103\r") == "t101101\rt101102\rt101103\r");
    if (answers) bench.adapter().say("z\r\az\r");
    bench.frames(0);
    CHECK(bench.bus().counters().written == 3);
    CHECK(bench.bus().counters().write_dropped == (answers ? 1 : 0));
    CHECK(bench.is_told("refuses frames") == answers);
  }
}

TEST_CASE("what an adapter says of its bus is told and counted") {
  Bench bench;
  bench.adapter().say("sa000000\rsb255000\rsb255000\re1s\r");
  CHECK(bench.is_told("bus-off"));
  CHECK(bench.bus().counters().error_frames == 1);
}

TEST_CASE("an adapter that is pulled out is waited for and set up again") {
  Bench bench;
  bench.adapter().hear("O\r");
  bench.adapter().say("t101101\r");
  CHECK(bench.frames(1).size() == 1);
  const int descriptor = bench.bus().file_descriptor();
  bench.pull_out();
  CHECK(bench.is_told("is gone"));
  CHECK(bench.bus().counters().times_down == 1);
  const std::array<CanFrame, 1> one = {reading(9)};
  CHECK(bench.bus().write(one) == 0);
  CHECK(bench.bus().counters().write_dropped == 1);
  bench.plug_in();
  CHECK(bench.is_told("is back"));
  CHECK(bench.adapter().hear("O\r").ends_with("C\rC\rS6\rO\r"));
  CHECK(bench.bus().file_descriptor() == descriptor);
  bench.adapter().say("t101102\r");
  const std::vector<CanFrame> frames = bench.frames(1);
  REQUIRE(frames.size() == 1);
  CHECK(frames[0].same_on_wire(reading(2)));
  CHECK(bench.bus().write(one) == 1);
  CHECK(bench.adapter().hear("t101109\r") == "t101109\r");
}

}  // namespace holdfast
