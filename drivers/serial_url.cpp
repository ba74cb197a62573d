#include "drivers/serial_url.h"

#include <algorithm>
#include <charconv>
#include <system_error>

#include "common/errors.h"

namespace holdfast {

int serial_number_of(const std::string& url, std::string_view text, const char* form) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size())
    throw UsageError(url + ": '" + std::string(text) + "' is no number; " + form);
  return value;
}

SerialUrl SerialUrl::parse(const std::string& url, std::string_view rest, const char* form) {
  SerialUrl parsed;
  const std::size_t question = rest.find('?');
  std::string_view options = question == rest.npos ? "" : rest.substr(question + 1);
  rest = rest.substr(0, question);
  const std::size_t at = rest.rfind('@');
  if (at != rest.npos) parsed.baud = serial_number_of(url, rest.substr(at + 1), form);
  parsed.device = rest.substr(0, at);
  if (parsed.device.empty()) throw UsageError(url + ": names no device; " + form);
  while (!options.empty()) {
    const std::string_view option = options.substr(0, options.find('&'));
    options.remove_prefix(std::min(options.size(), option.size() + 1));
    const std::string_view key = option.substr(0, option.find('='));
    parsed.options.emplace_back(key, option.substr(std::min(option.size(), key.size() + 1)));
  }
  return parsed;
}

}  // namespace holdfast
