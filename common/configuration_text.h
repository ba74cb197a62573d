#pragma once

#include <yaml-cpp/yaml.h>

#include <string>

namespace holdfast {

/// Values, keys and lists that a configuration may hold, an alias counted in each place where it
/// stands: each takes some 500 bytes when it is parsed, and no scenario of ours has a ninth of
/// these. The length of a text is not bounded, so that a vendor's DBC has room.
inline constexpr std::size_t kValuesMax = 50'000;

/// Throws ConfigurationError, which begins with the place, when a text holds more than kValuesMax,
/// more commas and opened brackets than these would need, or by aliases far more than it is long;
/// YAML::Exception for what is not YAML. Builds nothing.
void check_num_values(const std::string& text, const std::string& place);
/// The one document of the text; null when there is none, undefined when there are several. Throws
/// as check_num_values() does.
YAML::Node one_document(const std::string& text, const std::string& place);

/// Throws ConfigurationError, which begins with the place, for a document that its aliases make
/// endless or too large, or that is nested more than 100 deep.
void require_finite(const YAML::Node& document, const std::string& place);

}  // namespace holdfast
