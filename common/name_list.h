#pragma once

#include <string>
#include <vector>

namespace holdfast {

/// "a, b, c" for a message that says which names there are; "none" when there is none.
inline std::string name_list(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  return list.empty() ? "none" : list;
}

}  // namespace holdfast
