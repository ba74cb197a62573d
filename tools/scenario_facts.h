#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "tools/path_plot.h"

namespace holdfast {

/// States whose error is one number. An index that is no whole number stands as one that no state
/// has.
struct StateGroupFacts {
  std::string name, unit;
  std::vector<std::size_t> states;
};

/// What a review needs of a resolved scenario. Read leniently, since outsiders write logs too: what
/// is missing or of another kind stays empty.
struct ScenarioFacts {
  std::int64_t num_steps = 0;  // 0: not said
  std::vector<std::string> state_names;
  std::vector<StateGroupFacts> groups;
  std::vector<std::pair<std::string, bool>> estimators;  // name, is campaign only
  std::vector<PlotPoint> sensors;
};

/// Throws UsageError, which names the place, when the text is no YAML.
ScenarioFacts read_scenario_facts(const std::string& yaml, const std::string& place);

/// EST_ channels of a resolved scenario whose estimators see clean measurements, so that no live
/// run has them. None when the text is no scenario.
std::vector<std::string> campaign_only_channels(const std::string& scenario);

}  // namespace holdfast
