#include "drivers/can/candump_log.h"

#include <charconv>
#include <cstdio>
#include <optional>

#include "drivers/can/hex_bytes.h"

namespace holdfast {
namespace {

constexpr std::uint32_t kErrorBit = 0x20000000;
constexpr std::uint32_t kExtendedMask = 0x1FFFFFFF;
constexpr std::uint8_t kWireBitRateSwitch = 1, kWireErrorState = 2;
constexpr std::size_t kInterfaceNameMax = 15;

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  return -1;
}

template <class Number>
bool read_number(std::string_view text, int base, Number& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  return error == std::errc{} && end == text.data() + text.size();
}

/// Takes the text up to the separator off the front of line.
std::optional<std::string_view> take_until(std::string_view& line, char separator) {
  const std::size_t place = line.find(separator);
  if (place == std::string_view::npos) return std::nullopt;
  const std::string_view taken = line.substr(0, place);
  line.remove_prefix(place + 1);
  return taken;
}

bool read_time(std::string_view text, std::int64_t& time_ns) {
  const auto seconds_text = take_until(text, '.');
  if (!seconds_text || seconds_text->empty() || seconds_text->size() > 10) return false;
  std::uint64_t seconds = 0, fraction = 0;
  if (!read_number(*seconds_text, 10, seconds) || !read_number(text, 10, fraction)) return false;
  // Seconds of 10 digits at 9 more would overflow: 9223372036 s is the year 2262.
  constexpr std::uint64_t kSecondsMax = 9'223'372'035;
  if (seconds > kSecondsMax || (text.size() != 6 && text.size() != 9)) return false;
  time_ns = static_cast<std::int64_t>(seconds * 1'000'000'000 +
                                      (text.size() == 6 ? fraction * 1000 : fraction));
  return true;
}

/// Reads pairs of digits with an optional "." between two; leaves what follows them in text.
bool read_data(std::string_view& text, std::size_t num_bytes_max, CanFrame& frame) {
  std::size_t num_bytes = 0;
  while (!text.empty() && text.front() != '_') {
    if (text.front() == '.' && num_bytes > 0) text.remove_prefix(1);
    if (text.size() < 2 || num_bytes == num_bytes_max) return false;
    const int high = hex_digit(text[0]), low = hex_digit(text[1]);
    if (high < 0 || low < 0) return false;
    frame.data[num_bytes++] = static_cast<std::uint8_t>(high * 16 + low);
    text.remove_prefix(2);
  }
  frame.num_bytes = static_cast<std::uint8_t>(num_bytes);
  return true;
}

bool read_identifier(std::string_view text, CanFrame& frame) {
  for (const char c : text) {
    if (hex_digit(c) < 0) return false;
  }
  if (!read_number(text, 16, frame.identifier)) return false;
  if (text.size() == 3) return true;
  if (text.size() != 8) return false;
  if ((frame.identifier & kErrorBit) != 0) {
    frame.flags |= CanFrame::kError;
    frame.identifier &= ~kErrorBit;
  } else {
    frame.flags |= CanFrame::kExtended;
  }
  return frame.identifier <= kExtendedMask;
}

/// The raw length code that may follow a length of 8: candump -8 writes it.
bool is_raw_length_code(std::string_view text, std::size_t num_bytes) {
  return text.empty() ||
         (num_bytes == 8 && text.size() == 2 && text[0] == '_' && hex_digit(text[1]) >= 9);
}

bool read_remote(std::string_view text, CanFrame& frame) {
  frame.flags |= CanFrame::kRemote;
  if (!text.empty() && text.front() >= '0' && text.front() <= '8') {
    frame.num_bytes = static_cast<std::uint8_t>(text.front() - '0');
    text.remove_prefix(1);
  }
  return is_raw_length_code(text, frame.num_bytes);
}

bool read_fd(std::string_view text, CanFrame& frame) {
  const int wire_flags = text.empty() ? -1 : hex_digit(text.front());
  if (wire_flags < 0) return false;
  frame.flags |= CanFrame::kFd;
  if ((wire_flags & kWireBitRateSwitch) != 0) frame.flags |= CanFrame::kBitRateSwitch;
  if ((wire_flags & kWireErrorState) != 0) frame.flags |= CanFrame::kErrorStateIndicator;
  text.remove_prefix(1);
  return read_data(text, CanFrame::kBytesMax, frame) && text.empty();
}

bool read_frame(std::string_view text, CanFrame& frame) {
  const auto identifier = take_until(text, '#');
  if (!identifier || !read_identifier(*identifier, frame)) return false;
  bool is_good = false;
  if (!text.empty() && text.front() == '#') {
    is_good = read_fd(text.substr(1), frame);
  } else if (!text.empty() && (text.front() == 'R' || text.front() == 'r')) {
    is_good = read_remote(text.substr(1), frame);
  } else {
    is_good = read_data(text, 8, frame) && is_raw_length_code(text, frame.num_bytes);
  }
  if (frame.has(CanFrame::kError) && frame.num_bytes != 8) return false;
  return is_good && is_valid(frame);
}

bool read_record(std::string_view line, CandumpRecord& record) {
  line.remove_prefix(1);
  const auto time = take_until(line, ')');
  if (!time || !read_time(*time, record.time_ns)) return false;
  if (line.empty() || line.front() != ' ') return false;
  line.remove_prefix(1);
  const auto name = take_until(line, ' ');
  if (!name || name->empty() || name->size() > kInterfaceNameMax) return false;
  record.interface_name = *name;
  const std::size_t frame_end = line.find(' ');
  if (frame_end != std::string_view::npos) {
    const std::string_view direction = line.substr(frame_end + 1);
    if (direction != "R" && direction != "T") return false;
    line = line.substr(0, frame_end);
  }
  return read_frame(line, record.frame);
}

}  // namespace

CandumpLine parse_candump_line(std::string_view line, CandumpRecord& record) {
  while (!line.empty() && (line.back() == '\n' || line.back() == '\r' || line.back() == ' ')) {
    line.remove_suffix(1);
  }
  if (line.empty() || line.front() != '(') return CandumpLine::kComment;
  CandumpRecord parsed;
  if (!read_record(line, parsed)) return CandumpLine::kBroken;
  parsed.frame.receive_time_ns = parsed.time_ns;
  record = std::move(parsed);
  return CandumpLine::kFrame;
}

std::string format_candump_line(const CandumpRecord& record) {
  const CanFrame& frame = record.frame;
  const long long utime = record.time_ns / 1000;
  char time[40];
  std::snprintf(time, sizeof time, "(%010lld.%06lld) ", utime / 1'000'000, utime % 1'000'000);
  std::string line = time;
  line += record.interface_name;
  line += ' ';
  if (frame.has(CanFrame::kError)) {
    append_hex(frame.identifier | kErrorBit, 8, line);
  } else {
    append_hex(frame.identifier, frame.has(CanFrame::kExtended) ? 8 : 3, line);
  }
  line += '#';
  if (frame.has(CanFrame::kRemote)) {
    line += 'R';
    if (frame.num_bytes > 0) line += static_cast<char>('0' + frame.num_bytes);
  } else if (frame.has(CanFrame::kFd)) {
    line += '#';
    append_hex((frame.has(CanFrame::kBitRateSwitch) ? kWireBitRateSwitch : 0U) |
                   (frame.has(CanFrame::kErrorStateIndicator) ? kWireErrorState : 0U),
               1, line);
  }
  for (const std::uint8_t byte : frame.bytes()) append_hex(byte, 2, line);
  return line;
}

}  // namespace holdfast
