#include "drivers/can/hex_bytes.h"

#include <charconv>

namespace holdfast {

std::optional<std::vector<std::uint8_t>> parse_hex_bytes(std::string_view text) {
  std::vector<std::uint8_t> bytes;
  while (!text.empty()) {
    if (text.front() == ' ' || text.front() == '.') {
      text.remove_prefix(1);
      continue;
    }
    std::uint8_t byte = 0;
    const char* const end = text.data() + 2;
    if (text.size() < 2 || std::from_chars(text.data(), end, byte, 16).ptr != end)
      return std::nullopt;
    bytes.push_back(byte);
    text.remove_prefix(2);
  }
  if (bytes.empty()) return std::nullopt;
  return bytes;
}

void append_hex(std::uint32_t value, int num_digits, std::string& text) {
  constexpr std::string_view kHexDigits = "0123456789ABCDEF";
  for (int shift = 4 * (num_digits - 1); shift >= 0; shift -= 4) {
    text += kHexDigits[value >> shift & 0xFU];
  }
}

std::string identifier_text(const CanFrame& frame) {
  std::string text;
  append_hex(frame.identifier, frame.has(CanFrame::kExtended) ? 8 : 3, text);
  return text;
}

}  // namespace holdfast
