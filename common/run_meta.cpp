#include "common/run_meta.h"

#include <Eigen/Core>
#include <holdfast/run_meta_t.hpp>
#include <iomanip>
#include <sstream>

#include "common/clock.h"
#include "common/errors.h"
#include "common/log_file.h"
#include "common/random_stream.h"
#include "common/version.h"

namespace holdfast {

std::string version_text() {
  return kVersion;
}

std::string commit_text() {
  return kCommit;
}

std::string scenario_hash(const std::string& scenario) {
  std::ostringstream text;
  text << std::hex << std::setw(16) << std::setfill('0') << stable_hash(scenario);
  return text.str();
}

run_meta_t to_message(const RunMeta& meta) {
  run_meta_t message;
  message.utime = wall_utime();
  message.seq = 0;
  message.name = meta.name;
  message.scenario = meta.scenario;
  message.scenario_hash = scenario_hash(meta.scenario);
  message.seed = meta.seed;
  message.run = meta.run;
  message.version = version_text();
  message.commit = commit_text();
  message.kernel = meta.kernel;
  std::ostringstream libraries;
  libraries << "compiler " << __VERSION__ << "\neigen " << EIGEN_WORLD_VERSION << '.'
            << EIGEN_MAJOR_VERSION << '.' << EIGEN_MINOR_VERSION;
  message.libraries = libraries.str();
  return message;
}

RunMeta read_run_meta(const std::string& log_file) {
  LogReader reader(log_file);
  LogEvent event;
  run_meta_t message;
  bool has_event = false;
  while (reader.next(event)) {
    has_event = true;
    if (event.channel == "RUN_META" && decode_guarded(event.data, message)) {
      return {message.name, message.scenario, message.seed, message.run, message.kernel};
    }
  }
  if (!has_event) throw UsageError(log_file + ": is no LCM log, or an empty one");
  throw UsageError(log_file +
                   ": holds no RUN_META, so it is not known which scenario it belongs to");
}

}  // namespace holdfast
