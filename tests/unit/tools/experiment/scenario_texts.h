#pragma once

#include <string>
#include <vector>

#include "common/errors.h"
#include "tools/experiment.h"

namespace holdfast::testing {

/// The file of a scenario that ships with the programs.
inline std::string scenario(const std::string& name) {
  return std::string(HOLDFAST_SOURCE_DIR) + "/scenarios/" + name + ".yaml";
}

/// What a scenario is refused with; empty when it is not.
inline std::string problems_of(const std::string& name, const std::vector<std::string>& overrides) {
  try {
    load_experiment(scenario(name), overrides);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "";
}

}  // namespace holdfast::testing
