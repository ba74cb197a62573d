#pragma once

#include <string>
#include <vector>

#include "common/configuration.h"

namespace holdfast {

/// "a, b, c" for a message that says which names there are; "none" when there is none.
inline std::string name_list(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  return list.empty() ? "none" : list;
}

/// Index of a name among the known ones; where it is none of them, -1, and a problem of the key
/// that says what they are of: "the plant's modes".
int find_name(ConfigurationMap& map, std::string_view key, const std::string& what,
              const std::string& name, const std::vector<std::string>& known);
/// The same for the name below the key, which must be there.
int read_name(ConfigurationMap& map, std::string_view key, const std::string& what,
              const std::vector<std::string>& known);

}  // namespace holdfast
