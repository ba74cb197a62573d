#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/can/can_frame.h"

namespace holdfast {

/// Bytes written as pairs of hexadecimal digits, "DE AD.beef"; spaces and dots may stand between
/// pairs. None when it is anything else, or empty.
std::optional<std::vector<std::uint8_t>> parse_hex_bytes(std::string_view text);

/// Appends the lowest num_digits digits of the value, upper case: as candump and SLCAN adapters
/// write.
void append_hex(std::uint32_t value, int num_digits, std::string& text);

/// The identifier as candump writes it: three digits, eight for one of 29 bits.
std::string identifier_text(const CanFrame& frame);

}  // namespace holdfast
