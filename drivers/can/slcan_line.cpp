#include "drivers/can/slcan_line.h"

#include <array>
#include <charconv>

#include "drivers/can/hex_bytes.h"

namespace holdfast {
namespace {

constexpr char kEnd = '\r', kBell = '\a';
constexpr std::size_t kStampDigits = 4;

// Takes so many hexadecimal digits from the front of the text.
bool take_hex(std::string_view& text, std::size_t num_digits, std::uint32_t& value) {
  if (text.size() < num_digits) return false;
  const char* const end = text.data() + num_digits;
  if (std::from_chars(text.data(), end, value, 16).ptr != end) return false;
  text.remove_prefix(num_digits);
  return true;
}

char kind_of(const CanFrame& frame) {
  const bool is_wide = frame.has(CanFrame::kExtended);
  if (frame.has(CanFrame::kRemote)) return is_wide ? 'R' : 'r';
  if (!frame.has(CanFrame::kFd)) return is_wide ? 'T' : 't';
  if (frame.has(CanFrame::kBitRateSwitch)) return is_wide ? 'B' : 'b';
  return is_wide ? 'D' : 'd';
}

std::uint8_t flags_of(char kind) {
  switch (kind) {
    case 'T':
      return CanFrame::kExtended;
    case 'r':
      return CanFrame::kRemote;
    case 'R':
      return CanFrame::kRemote | CanFrame::kExtended;
    case 'd':
      return CanFrame::kFd;
    case 'D':
      return CanFrame::kFd | CanFrame::kExtended;
    case 'b':
      return CanFrame::kFd | CanFrame::kBitRateSwitch;
    case 'B':
      return CanFrame::kFd | CanFrame::kBitRateSwitch | CanFrame::kExtended;
    default:
      return 0;
  }
}

bool parse_frame(std::string_view text, CanFrame& frame) {
  CanFrame read;
  read.flags = flags_of(text.front());
  text.remove_prefix(1);
  if (!take_hex(text, read.has(CanFrame::kExtended) ? 8 : 3, read.identifier)) return false;
  std::uint32_t code = 0;
  const bool is_remote = read.has(CanFrame::kRemote);
  // Some tools write a remote frame without its length.
  if (!(is_remote && text.empty()) && !take_hex(text, 1, code)) return false;
  if (!read.has(CanFrame::kFd) && code > 8) return false;
  read.num_bytes = kFrameLengths[code];
  // A remote frame has no bytes, but slcanpty writes as many as its length says.
  const std::size_t num_written = read.num_bytes;
  const bool has_odd_bytes =
      is_remote && text.size() >= 2 * num_written && text.size() != kStampDigits;
  for (std::size_t i = 0; i < (has_odd_bytes ? num_written : read.bytes().size()); ++i) {
    std::uint32_t byte = 0;
    if (!take_hex(text, 2, byte)) return false;
    if (!is_remote) read.data[i] = static_cast<std::uint8_t>(byte);
  }
  std::uint32_t stamp = 0;
  if (!text.empty() && (!take_hex(text, kStampDigits, stamp) || !text.empty())) return false;
  if (!is_valid(read)) return false;
  frame = read;
  return true;
}

}  // namespace

bool append_slcan_line(const CanFrame& frame, std::string& text) {
  if (frame.has(CanFrame::kError)) return false;
  text += kind_of(frame);
  append_hex(frame.identifier, frame.has(CanFrame::kExtended) ? 8 : 3, text);
  std::uint32_t code = 0;
  while (kFrameLengths[code] < frame.num_bytes) ++code;
  append_hex(code, 1, text);
  for (const std::uint8_t byte : frame.bytes()) append_hex(byte, 2, text);
  text += kEnd;
  return true;
}

SlcanLine parse_slcan_line(std::string_view line, CanFrame& frame) {
  if (line.empty() || line == "z" || line == "Z") return SlcanLine::kAcknowledged;
  switch (line.front()) {
    case 't':
    case 'T':
    case 'r':
    case 'R':
    case 'd':
    case 'D':
    case 'b':
    case 'B':
      return parse_frame(line, frame) ? SlcanLine::kFrame : SlcanLine::kBroken;
    case 's':
      return line.size() >= 2 && std::string_view("awpb").find(line[1]) != std::string_view::npos
                 ? SlcanLine::kBusState
                 : SlcanLine::kBroken;
    case 'e':
      return line.size() >= 2 ? SlcanLine::kBusError : SlcanLine::kBroken;
    case 'V':
    case 'v':
    case 'N':
    case 'F':
      return SlcanLine::kAnswer;
    default:
      return SlcanLine::kBroken;
  }
}

void SlcanReader::end_line(const OnLine& on_line) {
  CanFrame frame;
  const SlcanLine kind = is_too_long_ ? SlcanLine::kBroken : parse_slcan_line(line_, frame);
  on_line(kind, frame, line_);
  reset();
}

void SlcanReader::take(std::span<const char> bytes, const OnLine& on_line) {
  for (const char byte : bytes) {
    if (byte == kEnd) {
      end_line(on_line);
    } else if (byte == kBell) {
      // It refuses what was asked, whatever frame is under way.
      on_line(SlcanLine::kRefused, {}, {});
    } else if (byte == '\n' && line_.empty()) {
      continue;  // some adapters end lines with both
    } else if (line_.size() < kBytesMax) {
      line_ += byte;
    } else {
      is_too_long_ = true;
    }
  }
}

}  // namespace holdfast
