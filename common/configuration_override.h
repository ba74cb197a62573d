#pragma once

#include <yaml-cpp/yaml.h>

#include <string>

namespace holdfast {

/// Sets "path.to.key=value" in a document; a list item is named by its index or by its key "name",
/// and `list[0]` is the same as `list.0`. Maps on the way that are not there are made.
///
/// The value is read as if it stood on that line (from 0), so that its marks tell it from the
/// file's own. Throws UsageError when the path leads nowhere or the value is no YAML.
void apply_override(const YAML::Node& root, const std::string& assignment, int line);

}  // namespace holdfast
