#pragma once

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
/// Says on stderr how much of a log, read to its end, was damaged; nothing where nothing was.
void warn_of_damage(const std::string& program, const std::string& log_file,
                    const LogReader& reader);
/// Says on stderr that estimates may differ in their last bits, where the log's kernel is another.
void warn_of_kernel(const std::string& program, const Experiment& experiment, const RunMeta& meta);

}  // namespace holdfast
