#pragma once

#include <string>

#include "common/run_meta.h"
#include "tools/experiment.h"
#include "tools/scenario_facts.h"

namespace holdfast {

struct LoggedMeta {
  RunMeta meta;
  bool is_damaged = false;  // the scenario's text does not have the hash that was logged with it
};

/// RUN_META of a log: the first whose scenario is whole, else the first. A live run repeats it, so
/// one that was damaged costs nothing. Throws UsageError when there is none.
LoggedMeta read_logged_meta(const std::string& log_file);

/// A log's run, made from nothing but its RUN_META.
struct LoggedExperiment {
  RunMeta meta;
  Experiment experiment;
};

/// Throws UsageError when the log has no RUN_META, or none with a whole scenario of ours.
LoggedExperiment read_logged_experiment(const std::string& log_file);

/// What its scenario says, the experiment included; nothing when it is damaged and no YAML any
/// more, or too large. Throws UsageError, which names the place, when a whole one is so.
ScenarioFacts facts_of(const LoggedMeta& logged, const std::string& place);

}  // namespace holdfast
