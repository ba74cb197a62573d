#pragma once

#include <string>
#include <string_view>

namespace holdfast {

/// Text from a log or a bus, made safe to show: valid UTF-8 without control characters (those
/// become \xNN, a broken byte becomes '?'), cut at max_bytes.
std::string printable(std::string_view text, std::size_t max_bytes = 400);

/// The same, with the characters that XML reserves escaped; for text and attributes.
std::string printable_xml(std::string_view text, std::size_t max_bytes = 400);

/// Columns that printable text takes on a terminal, one for each code point.
std::size_t text_width(std::string_view text);

}  // namespace holdfast
