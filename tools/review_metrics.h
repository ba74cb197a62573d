#pragma once

#include <string>
#include <vector>

#include "tools/log_review.h"
#include "tools/log_trace.h"
#include "tools/metrics/metrics.h"
#include "tools/scenario_facts.h"

namespace holdfast {

/// Scores one estimator of a log against the truth, step by step.
///
/// A step counts as attacked when ATTACK_FRAME has a record of it or an ATTACK_SIGNAL is not zero
/// in it; a packet does when its label says so. Unknown labels and outcomes count nowhere. The name
/// says whose modes the estimator's are, where the scenario has it.
RunScores score_estimator(const ScenarioFacts& facts, const LogTrace& trace,
                          const FrameLabels& labels, const std::string& name,
                          const EstimatorTrace& estimator);

/// 1 for each attacked step, else 0; empty when the log does not tell.
std::vector<double> attacked_steps(const LogTrace& trace);

/// Fills what a review says of the errors of an estimator from its scores: everything in `metrics`,
/// and of that the RMSE over time, the NEES and the packets' AUC.
void review_scores(const RunReview& run, RunScores scores, EstimatorReview& review);

/// Metrics over several logs of one scenario.
struct CombinedReview {
  std::string name, family;
  std::vector<std::string> files;  // in the order of the runs
  std::vector<EstimatorMetrics> estimators;
  std::vector<PairedDifference> differences;  // to the first estimator
  std::vector<std::string> notes;
};

/// One for each scenario that at least two logs have in common, whatever their seeds and runs.
std::vector<CombinedReview> combine_reviews(const std::vector<RunReview>& reviews);

}  // namespace holdfast
