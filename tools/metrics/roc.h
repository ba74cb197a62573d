#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "tools/metrics/metrics.h"
#include "tools/metrics/statistics.h"

namespace holdfast {

/// A score of one step of one run; positive when attacked.
struct RunScore {
  double score;
  std::uint32_t run;
  bool is_positive;
};

/// A curve, and its area with standard error; no value unless there are both kinds.
struct Roc {
  RocCurve curve;
  Statistic area;
};

/// Exact area over all scores, ties one half; the curve is thinned to at most 500 points. Standard
/// error: the area linearised in the runs' contributions. Precondition: no score is NaN.
Roc roc_of_scores(std::vector<RunScore> scores, std::size_t num_runs);

/// The same for binned scores, scores of one bin being ties. The standard error needs the runs'
/// own histograms; without them there is none.
Roc roc_of_histogram(const ScoreHistogram& all, std::span<const ScoreHistogram> of_runs);

}  // namespace holdfast
