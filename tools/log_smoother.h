#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "estimators/attack_statistics.h"

namespace holdfast {

/// What holdfast-smoother is asked for.
struct LogSmootherOptions {
  std::string log_file, out_file;
  std::string program = "holdfast-smoother";  // says what of the log is damaged; "": nobody
  std::string name;                       // of the estimator; "": each one with a key `smoother`
  std::optional<std::int64_t> lag_steps;  // instead of the scenario's; 0: by the whole run
  std::optional<AttackStatistics> statistics;  // instead of what an attack_mixture assumes
  std::function<void(std::int64_t step, std::int64_t num_steps)> on_progress;  // may be empty
};

/// Runs estimators of a log's scenario again on its MEASUREMENT and looks back: the new log holds
/// every event of the old one and SMOOTHED_<NAME>, each estimate behind the measurement set of its
/// step. Returns the number of smoothed estimates.
///
/// Throws UsageError for a log without scenario or measurement sets, and for an estimator that is
/// not there or cannot look back; JobError when the new log cannot be written, and then there is
/// none.
std::int64_t smooth_log(const LogSmootherOptions& options);

}  // namespace holdfast
