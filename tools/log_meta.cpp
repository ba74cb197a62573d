#include "tools/log_meta.h"

#include <exception>
#include <holdfast/run_meta_t.hpp>
#include <memory>

#include "common/errors.h"
#include "common/log_file.h"
#include "tools/experiment.h"

namespace holdfast {
namespace {

// Null for what an outsider or another version wrote: a review does with less.
std::shared_ptr<const Experiment> experiment_of(const std::string& scenario) {
  try {
    return std::make_shared<Experiment>(experiment_from_text(scenario, "RUN_META"));
  } catch (const std::exception&) {
    return nullptr;
  }
}

}  // namespace

LoggedMeta read_logged_meta(const std::string& log_file) {
  LogReader reader(log_file);
  LogEvent event;
  while (reader.next(event)) {
    run_meta_t message;
    if (event.channel != "RUN_META" || !decode_guarded(event.data, message)) continue;
    // Whoever leaves the hash empty has none to compare with.
    if (!message.scenario_hash.empty() && message.scenario_hash != scenario_hash(message.scenario))
      continue;
    return {{message.name, message.scenario, message.seed, message.run, message.kernel}, false};
  }
  return {read_run_meta(log_file), true};
}

LoggedExperiment read_logged_experiment(const std::string& log_file) {
  const LoggedMeta logged = read_logged_meta(log_file);
  if (logged.is_damaged) throw UsageError(log_file + ": the scenario in its RUN_META is damaged");
  return {logged.meta, experiment_from_text(logged.meta.scenario, log_file + " (RUN_META)")};
}

ScenarioFacts facts_of(const LoggedMeta& logged, const std::string& place) {
  try {
    ScenarioFacts facts = read_scenario_facts(logged.meta.scenario, place);
    facts.experiment = experiment_of(logged.meta.scenario);
    return facts;
  } catch (const UsageError&) {
    if (!logged.is_damaged) throw;
    return {};
  }
}

}  // namespace holdfast
