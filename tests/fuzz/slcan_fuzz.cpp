// libFuzzer target: what an SLCAN adapter says reads the same however it is split, and each frame
// in it is written and read again as it was.

#include "drivers/can/slcan_line.h"

#include <algorithm>
#include <string>
#include <vector>

#include "tests/fuzz/support.h"

namespace holdfast {
namespace {

using fuzzing::must;

struct Line {
  SlcanLine kind;
  CanFrame frame;
  std::string text;

  bool operator==(const Line& other) const {
    return kind == other.kind && frame.same_on_wire(other.frame) && text == other.text;
  }
};

std::vector<Line> lines_of(std::span<const char> bytes, std::size_t piece) {
  SlcanReader reader;
  std::vector<Line> lines;
  while (!bytes.empty()) {
    const std::span<const char> part = bytes.first(std::min(piece, bytes.size()));
    reader.take(part, [&lines](SlcanLine kind, const CanFrame& frame, std::string_view text) {
      lines.push_back({kind, frame, std::string(text)});
    });
    bytes = bytes.subspan(part.size());
  }
  return lines;
}

// The protocol has no place for the error state.
void check_frame(CanFrame frame) {
  frame.flags = static_cast<std::uint8_t>(frame.flags & ~CanFrame::kErrorStateIndicator);
  must(is_valid(frame));
  std::string text;
  must(append_slcan_line(frame, text) && text.size() <= SlcanReader::kBytesMax);
  const std::vector<Line> lines = lines_of(text, text.size());
  must(lines.size() == 1 && lines[0].kind == SlcanLine::kFrame);
  must(lines[0].frame.same_on_wire(frame));
}

}  // namespace
}  // namespace holdfast

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace holdfast;
  const std::string_view text = fuzzing::text_of(data, size);
  const std::vector<Line> lines = lines_of(text, size);
  for (const std::size_t piece : {1, 2, 7, 160}) must(lines_of(text, piece) == lines);
  for (const Line& line : lines) {
    must(line.text.size() <= SlcanReader::kBytesMax);
    if (line.kind == SlcanLine::kFrame) check_frame(line.frame);
  }
  fuzzing::Input input(data, size);
  check_frame(input.take_frame());
  return 0;
}
