#pragma once

#include <iosfwd>
#include <string>
#include <vector>

#include "drivers/can/dbc.h"

namespace holdfast {

/// Reads a DBC file. Throws UsageError when it cannot be read; what is not understood in it stands
/// in its problems.
Dbc load_dbc(const std::string& file);

/// "FILE:LINE:COLUMN: what" for each problem, on lines.
std::string problems_text(const Dbc& dbc, const std::string& file);

/// Messages and signals as a table for people: identifier, length, sender; bits, kind, scale,
/// range, unit, multiplexing, names of values.
std::string list_text(const Dbc& dbc);

struct DecodeCounts {
  std::int64_t frames = 0;   // that were read
  std::int64_t decoded = 0;  // of a message of the DBC, in its form
  std::int64_t unknown = 0;  // identifier that the DBC has not
  std::int64_t wrong_format = 0;
  std::int64_t broken_lines = 0;
};

/// Decodes a recording in the format of candump -L into CSV, a line for each signal that a frame
/// carries: time_s, interface, identifier, message, signal, value, unit, name.
DecodeCounts decode_to_csv(const Dbc& dbc, std::istream& log, std::ostream& csv);

/// The frame of a message with these signals ("NAME=VALUE", a number or a name of the signal's
/// values), all other bits zero, as cansend takes it. Multiplexers are set to what their signals
/// need. A value that the signal rounds, or that lies beyond its limits, is written all the same;
/// the remarks say so. Throws UsageError for names that the DBC has not, values that do not fit the
/// bits, and signals that no frame carries together.
std::string encode_text(const Dbc& dbc, const std::string& message,
                        const std::vector<std::string>& signals, std::vector<std::string>& remarks);

}  // namespace holdfast
