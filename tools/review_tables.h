#pragma once

#include <string>
#include <vector>

#include "tools/log_review.h"
#include "tools/report/figure.h"
#include "tools/review_metrics.h"

namespace holdfast {

/// One row for each estimator: RMSE over time by state group, steps, outcomes, NEES, AUC, times.
ReportTable error_table(const RunReview& review);

/// One row for each metric, one column for each estimator, standard errors behind the values. The
/// RMSEs may be left out, since those of a single run have a table of their own.
ReportTable metric_table(const std::vector<const EstimatorMetrics*>& estimators, bool has_rmse);
ReportTable metric_table(const RunReview& review);

/// Step times and latencies of each estimator, and in the note the deadlines that the plant missed.
ReportTable time_table(const RunReview& review);

ReportTable rule_table(const RunReview& review);

/// Paired differences of a combined review.
ReportTable difference_table(const CombinedReview& combined);

/// All tables of a report page, those without rows left out. Text from the log is printable.
std::vector<ReportTable> report_tables(const RunReview& review);

/// Metrics and paired differences over several logs.
std::vector<ReportTable> combined_tables(const CombinedReview& combined);

/// A table as aligned plain text, without its title; empty when it has no rows.
std::string text_of(const ReportTable& table);

}  // namespace holdfast
