#pragma once

#include <yaml-cpp/yaml.h>

#include <string>

namespace holdfast {

/// The one document of the text; null when there is none, undefined when there are several. Throws
/// YAML::Exception for what is not YAML.
YAML::Node one_document(const std::string& text);

/// Throws ConfigurationError, which begins with the place, for a document that its aliases make
/// endless, or far larger than its text is: no reader need fear to follow them.
void require_finite(const YAML::Node& document, const std::string& text, const std::string& place);

}  // namespace holdfast
