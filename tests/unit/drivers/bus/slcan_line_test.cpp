#include "drivers/can/slcan_line.h"

#include <random>

#include "common/errors.h"
#include "drivers/can/slcan_bus.h"
#include "tests/support/catch.h"
#include "tests/support/frames.h"

namespace holdfast {
namespace {

using testing::frame_of;

CanFrame remote_of(std::uint32_t identifier, std::uint8_t flags, std::uint8_t num_bytes) {
  CanFrame frame = frame_of(identifier, flags | CanFrame::kRemote, {});
  frame.num_bytes = num_bytes;
  return frame;
}

std::string line_of(const CanFrame& frame) {
  std::string line;
  const bool is_appended = append_slcan_line(frame, line);
  CHECK(is_appended == !line.empty());
  return line;
}

struct Line {
  SlcanLine kind;
  CanFrame frame;
};

std::vector<Line> lines_of(SlcanReader& reader, const std::string& bytes) {
  std::vector<Line> lines;
  reader.take(bytes, [&lines](SlcanLine kind, const CanFrame& frame, std::string_view) {
    lines.push_back({kind, frame});
  });
  return lines;
}

}  // namespace

TEST_CASE("frames are lines of the protocol, and back") {
  const std::vector<std::pair<CanFrame, std::string>> cases = {
      {frame_of(0x123, 0, {0xDE, 0xAD}), "t1232DEAD\r"},
      {frame_of(0x7FF, 0, {}), "t7FF0\r"},
      {frame_of(0x1ABCDEF0, CanFrame::kExtended, {1}), "T1ABCDEF0101\r"},
      {remote_of(0x10, 0, 4), "r0104\r"},
      {remote_of(0x10, CanFrame::kExtended, 8), "R000000108\r"},
      {frame_of(0x55, CanFrame::kFd, std::vector<std::uint8_t>(12, 0xAB)),
       "d0559" + std::string("ABABABABABABABABABABABAB") + "\r"},
      {frame_of(0x55, CanFrame::kFd | CanFrame::kBitRateSwitch | CanFrame::kExtended, {7}),
       "B00000055107\r"}};
  for (const auto& [frame, line] : cases) {
    INFO(line);
    CHECK(line_of(frame) == line);
    CanFrame back;
    CHECK(parse_slcan_line(line.substr(0, line.size() - 1), back) == SlcanLine::kFrame);
    CHECK(back.same_on_wire(frame));
  }
  CHECK(line_of(frame_of(4, CanFrame::kError, std::vector<std::uint8_t>(8, 0))) == "");
}

TEST_CASE(
    "what adapters write, with stamps and without lengths, is read; what is no frame is told") {
  CanFrame frame;
  CHECK(parse_slcan_line("t1232DEADEA5F", frame) == SlcanLine::kFrame);  // a stamp behind it
  CHECK(frame.same_on_wire(frame_of(0x123, 0, {0xDE, 0xAD})));
  CHECK(parse_slcan_line("r123", frame) == SlcanLine::kFrame);
  CHECK(frame.same_on_wire(remote_of(0x123, 0, 0)));
  CHECK(parse_slcan_line("t12310a", frame) == SlcanLine::kFrame);  // lower case
  // Bytes behind a remote frame, as can-utils' slcanpty writes them, stamps, and both.
  for (const char* line : {"r12381122334455667788", "r1238EA5F", "r12381122334455667788EA5F"}) {
    INFO(line);
    CHECK(parse_slcan_line(line, frame) == SlcanLine::kFrame);
    CHECK(frame.same_on_wire(remote_of(0x123, 0, 8)));
  }
  for (const char* line : {"", "z", "Z"})
    CHECK(parse_slcan_line(line, frame) == SlcanLine::kAcknowledged);
  CHECK(parse_slcan_line("sb255000", frame) == SlcanLine::kBusState);
  CHECK(parse_slcan_line("e1s", frame) == SlcanLine::kBusError);
  for (const char* line : {"V1013", "NA123", "F00"})
    CHECK(parse_slcan_line(line, frame) == SlcanLine::kAnswer);
  frame = frame_of(0x77, 0, {9});
  for (const char* line : {"t", "t12", "t1239", "t12391122334455667788FF", "t8000", "t1232DE",
                           "t1232DEADE", "T1232DEAD", "TFFFFFFFF0", "tG230", "x123", "s", "sx", "e",
                           "r123A", "r123811", "r12311G", "d123G", "t123-1"}) {
    INFO(line);
    CHECK(parse_slcan_line(line, frame) == SlcanLine::kBroken);
    CHECK(frame.same_on_wire(frame_of(0x77, 0, {9})));
  }
}

TEST_CASE("lines are the same however their bytes are split or joined") {
  const std::string bytes =
      "t1232DEAD\rz\r\n\r\aT1ABCDEF0101\r\n" + std::string(400, 'q') + "\rt0010\r";
  SlcanReader whole;
  const std::vector<Line> expected = lines_of(whole, bytes);
  REQUIRE(expected.size() == 7);
  CHECK(expected[3].kind == SlcanLine::kRefused);
  CHECK(expected[5].kind == SlcanLine::kBroken);
  CHECK(expected[6].frame.identifier == 1);
  for (std::size_t size = 1; size < 20; ++size) {
    SlcanReader reader;
    std::vector<Line> lines;
    for (std::size_t at = 0; at < bytes.size(); at += size) {
      for (const Line& line : lines_of(reader, bytes.substr(at, size))) lines.push_back(line);
    }
    REQUIRE(lines.size() == expected.size());
    for (std::size_t i = 0; i < lines.size(); ++i) {
      CHECK(lines[i].kind == expected[i].kind);
      CHECK(lines[i].frame.same_on_wire(expected[i].frame));
    }
  }
}

TEST_CASE("whatever bytes come, every frame that is told is one that could be sent") {
  std::minstd_rand random(11);
  const std::string letters = "tTrRdDbBzZsevNF0123456789ABCDEFabcdef\r\r\r\n\a\xff";
  SlcanReader reader;
  std::int64_t num_frames = 0, num_broken = 0;
  for (int round = 0; round < 20000; ++round) {
    // A sound line, of which a byte is another one every other time, and some noise.
    CanFrame frame = frame_of(random() & 0x7FF, 0, std::vector<std::uint8_t>(random() % 9, 0x5A));
    std::string bytes = line_of(frame);
    if (random() % 2 == 0) bytes[random() % bytes.size()] = letters[random() % letters.size()];
    if (random() % 8 == 0) bytes += letters[random() % letters.size()];
    for (const Line& line : lines_of(reader, bytes)) {
      if (line.kind == SlcanLine::kBroken) ++num_broken;
      if (line.kind != SlcanLine::kFrame) continue;
      ++num_frames;
      REQUIRE(is_valid(line.frame));
      REQUIRE_FALSE(line_of(line.frame).empty());
    }
  }
  CHECK(num_frames > 10000);
  CHECK(num_broken > 1000);
}

TEST_CASE("an adapter's URL says what it means, or what may stand there") {
  const SlcanUrl plain = SlcanUrl::parse("slcan:/dev/ttyACM0");
  CHECK(plain.device == "/dev/ttyACM0");
  CHECK(plain.baud == 115200);
  CHECK(plain.bitrate == 500000);
  const SlcanUrl full =
      SlcanUrl::parse("slcan:/dev/serial/by-id/a@b@1000000?bitrate=250000&fd_bitrate=2000000");
  CHECK(full.device == "/dev/serial/by-id/a@b");
  CHECK(full.baud == 1000000);
  CHECK(full.bitrate == 250000);
  CHECK(full.fd_bitrate == 2000000);
  const auto says = [](const std::string& url, const std::string& text) {
    std::string problem;
    try {
      SlcanUrl::parse(url);
    } catch (const UsageError& error) {
      problem = error.what();
    }
    INFO(url << ": " << problem);
    CHECK(problem.find(text) != std::string::npos);
  };
  says("slcan:", "names no device");
  says("slcan:/dev/x@fast", "is no number");
  says("slcan:/dev/x@1234", "is none of: 9600");
  says("slcan:/dev/x?bitrate=123", "bitrate must be");
  says("slcan:/dev/x?fd_bitrate=1000000", "fd_bitrate must be");
  says("slcan:/dev/x?speed=1", "no option 'speed'");
}

}  // namespace holdfast
