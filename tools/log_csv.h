#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace holdfast {

struct CsvExport {
  std::vector<std::string> files;  // names in the folder, in the order of the channels
  std::vector<std::string> notes;  // what was left out, and why
};

/// Writes one CSV for each channel of a log to a folder (made when missing), in two passes over the
/// file; memory does not grow with it.
///
/// Channels of our types: CHANNEL.csv, a row for each message and a column for each field; an array
/// has columns name[0], name[1], .. up to the largest met, empty where a message has fewer. Each
/// list of structs has a file of its own, CHANNEL.LIST.csv, with a row for each element behind the
/// numbers of its message that stand in front of the list. Messages that the guard refuses:
/// CHANNEL.refused.csv, bytes in hex. Other channels: CHANNEL.csv, bytes in hex. docs/review.md has
/// the rules in full. Throws UsageError for a log that cannot be read and JobError for a folder
/// that cannot be written.
CsvExport write_channel_csv(const std::string& log_file, const std::string& folder);

/// Text as a cell: control characters other than line ends escaped, broken UTF-8 replaced, quoted
/// after RFC 4180 where needed, and with ' in front of what a spreadsheet would run as a formula.
std::string csv_text(std::string_view text);

/// A channel's name as a part of a file's name: letters, digits, '_' and '-' stay, every other byte
/// becomes %XX; a long one is cut and ends with its hash. Different names stay different.
std::string file_name_of_channel(std::string_view channel);

}  // namespace holdfast
