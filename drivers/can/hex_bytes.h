#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

namespace holdfast {

/// Bytes written as pairs of hexadecimal digits, "DE AD.beef"; spaces and dots may stand between
/// pairs. None when it is anything else, or empty.
std::optional<std::vector<std::uint8_t>> parse_hex_bytes(std::string_view text);

}  // namespace holdfast
