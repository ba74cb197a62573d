#pragma once

#include <string>

namespace holdfast {

/// Runs the estimators of a log's own scenario on its measurement sets and writes a new log with
/// RUN_META, MEASUREMENT and EST_<NAME>.
///
/// name: one estimator, or "" for all of ours. Throws UsageError when the log has no RUN_META or no
/// measurement set, or when both names are one file; JobError when the new log cannot be written.
/// The new log appears under its name when it is complete.
void replay_log(const std::string& log_file, const std::string& out_file, const std::string& name);

}  // namespace holdfast
