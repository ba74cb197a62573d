#pragma once

#include <functional>
#include <string>

#include "common/log_file.h"
#include "common/run_meta.h"
#include "tools/experiment.h"

namespace holdfast {

/// Runs the estimators of a log's own scenario on its measurement sets and writes a new log with
/// RUN_META, MEASUREMENT, EST_<NAME> and, with a fixed lag, SMOOTHED_<NAME>.
///
/// name: one estimator, or "" for all of ours. Throws UsageError when the log has no RUN_META or no
/// measurement set, or when both names are one file; JobError when the new log cannot be written.
/// The new log appears under its name when it is complete.
void replay_log(const std::string& log_file, const std::string& out_file, const std::string& name);

/// Throws UsageError when a log to write is the log to read.
void check_new_log(const std::string& log_file, const std::string& out_file);
/// Calls on_set for each MEASUREMENT of a log, with the event that it came in. Says on stderr what
/// of the log was damaged, unless `program` is empty. Throws UsageError when there is none.
void for_each_set(const std::string& program, const std::string& log_file,
                  const std::function<void(const MeasurementSet&, const LogEvent&)>& on_set);
/// Says on stderr that estimates may differ in their last bits, where the log's kernel is another.
void warn_of_kernel(const std::string& program, const Experiment& experiment, const RunMeta& meta);

}  // namespace holdfast
