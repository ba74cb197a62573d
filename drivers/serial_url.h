#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace holdfast {

/// DEVICE[@BAUD][?KEY=VALUE][&KEY=VALUE]...: a serial line, whatever is spoken on it. The device
/// may hold an @ itself; the last one counts.
struct SerialUrl {
  std::string device;
  std::optional<int> baud;
  std::vector<std::pair<std::string, std::string>> options;

  /// url: for what it throws; rest: the url without its scheme; form: what may stand there. Throws
  /// UsageError when there is no device or a number is none.
  static SerialUrl parse(const std::string& url, std::string_view rest, const char* form);
};

/// A number of such a url; throws UsageError when it is none.
int serial_number_of(const std::string& url, std::string_view text, const char* form);

}  // namespace holdfast
