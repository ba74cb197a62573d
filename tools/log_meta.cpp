#include "tools/log_meta.h"

#include <holdfast/run_meta_t.hpp>

#include "common/errors.h"
#include "common/log_file.h"

namespace holdfast {
namespace {

// A parsed scenario takes some 250 times the memory of its text.
constexpr std::size_t kScenarioBytesMax = 1 << 18;

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

ScenarioFacts facts_of(const LoggedMeta& logged, const std::string& place) {
  if (logged.meta.scenario.size() > kScenarioBytesMax)
    throw UsageError(place + ": the scenario in its RUN_META is longer than 256 kB");
  try {
    return read_scenario_facts(logged.meta.scenario, place);
  } catch (const UsageError&) {
    if (!logged.is_damaged) throw;
    return {};
  }
}

}  // namespace holdfast
