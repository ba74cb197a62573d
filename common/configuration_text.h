#pragma once

#include <yaml-cpp/yaml.h>

#include <string>

namespace holdfast {

/// Values, keys and lists that a configuration may hold: each takes some 500 bytes when it is
/// parsed, and no scenario of ours has a tenth of these. The length of a text is not bounded, so
/// that a vendor's DBC has room.
inline constexpr std::size_t kValuesMax = 50'000;

/// Throws ConfigurationError, which begins with the place, when a text holds more than kValuesMax;
/// YAML::Exception for what is not YAML. Takes no more memory than the text.
void check_num_values(const std::string& text, const std::string& place);
/// The one document of the text; null when there is none, undefined when there are several. Throws
/// as check_num_values() does.
YAML::Node one_document(const std::string& text, const std::string& place);

/// Throws ConfigurationError, which begins with the place, for a document that its aliases make
/// endless, or far larger than its text is: no reader need fear to follow them.
void require_finite(const YAML::Node& document, const std::string& text, const std::string& place);

}  // namespace holdfast
