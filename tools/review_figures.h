#pragma once

#include <string>
#include <vector>

#include "tools/log_review.h"
#include "tools/report/figure.h"
#include "tools/review_metrics.h"

namespace holdfast {

/// Figures of one log, over the steps: states with 3-sigma bands, error norms, attack and mode
/// probabilities, innovations with thresholds, NIS and NEES, marks of touched and foreign frames,
/// packets, losses, step times and their distribution, and the path in the plane. What the log does
/// not hold is left out. Attacked steps are shaded.
std::vector<Figure> log_figures(const ReviewedLog& log);

/// Tables and figures of one log as a page.
Report log_report(const ReviewedLog& log);

/// Curves over the steps with their errors, and the tables, of several logs of one scenario.
Report combined_report(const CombinedReview& combined);

}  // namespace holdfast
