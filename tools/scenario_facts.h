#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tools/metrics/run_scores.h"
#include "tools/path_plot.h"

namespace holdfast {

struct Experiment;

/// An estimator, or the smoother of one, that a scenario names.
struct ListedEstimator {
  std::string name;
  bool is_campaign_only = false;  // knows what only a simulation does
  bool is_offline = false;        // looks back: not in a log before holdfast-smoother
};

/// What a review needs of a resolved scenario. Read leniently, since outsiders write logs too: what
/// is missing or of another kind stays empty.
struct ScenarioFacts {
  std::int64_t num_steps = 0;  // 0: not said
  double step_s = 0.0;         // of the plant's model; 0: not said
  double detection_threshold = 0.5;
  std::int64_t mode_hold_steps = 1;
  AttackTruth attack_truth = AttackTruth::kAny;
  std::vector<std::string> state_names;
  /// A state whose index is no whole number from 0 stands as one that no plant has.
  std::vector<StateGroup> groups;
  std::vector<ListedEstimator> estimators;
  std::vector<PlotPoint> sensors;
  std::string family;  // hash of the scenario but for its seed: runs that belong to one average
  std::shared_ptr<const Experiment> experiment;  // null when it is no whole scenario of ours
};

inline constexpr int kNoState = 1 << 30;

/// A state's name for an axis: "x_position_m" in m becomes "x position [m]". The unit is that of
/// the first group that holds the state.
std::string state_label(const ScenarioFacts& facts, int state);

/// Throws UsageError, which names the place, when the text is no YAML, or holds more than
/// kValuesMax.
ScenarioFacts read_scenario_facts(const std::string& yaml, const std::string& place);

/// Channels of estimates of a scenario's estimators that know what only a simulation does, so that
/// no live run has them.
std::vector<std::string> campaign_only_channels(const ScenarioFacts& facts);

}  // namespace holdfast
