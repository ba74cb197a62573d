#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "drivers/can/can_frame.h"

namespace holdfast {

/// One frame of a log as candump -L writes it.
struct CandumpRecord {
  std::int64_t time_ns = 0;    // since 1970, or of any other monotone base
  std::string interface_name;  // 1..15 characters, no spaces
  CanFrame frame;              // receive_time_ns equals time_ns after parsing
};

enum class CandumpLine {
  kFrame,
  kComment,  // does not start with "(": candump's own remarks, empty lines
  kBroken    // starts like a frame and is none, or is a CAN XL frame
};

/// Reads one line: "(seconds.fraction) interface frame [R|T]", fraction of 6 or 9 digits.
///
/// Frames: classic `123#DEADBEEF`, `00000123#` (8 digits: 29 bits), with an optional raw length
/// code
/// `_9`..`_F` after 8 bytes; remote `123#R` or `123#R4`; FD `123##1..` (1 bit-rate switch, 2 error
/// state, other bits ignored); error `20000040#` and 8 bytes. A "." may stand between bytes.
/// The record is only changed for kFrame.
CandumpLine parse_candump_line(std::string_view line, CandumpRecord& record);

/// Writes the line, without a line end, as candump -L of every version does: microseconds in
/// exactly 6 digits (rounded down), upper case, no direction. Precondition: is_valid(record.frame),
/// time >= 0.
std::string format_candump_line(const CandumpRecord& record);

}  // namespace holdfast
