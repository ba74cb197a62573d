#include "common/name_list.h"

#include <algorithm>

namespace holdfast {

int find_name(ConfigurationMap& map, std::string_view key, const std::string& what,
              const std::string& name, const std::vector<std::string>& known) {
  const auto found = std::find(known.begin(), known.end(), name);
  if (found != known.end()) return static_cast<int>(found - known.begin());
  map.problem(key, "'" + name + "' is none of " + what + ": " + name_list(known));
  return -1;
}

int read_name(ConfigurationMap& map, std::string_view key, const std::string& what,
              const std::vector<std::string>& known) {
  std::string name;
  map.require(key);
  map.read(key, name);
  return map.has(key) ? find_name(map, key, what, name, known) : -1;
}

}  // namespace holdfast
