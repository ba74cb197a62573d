#pragma once

#include <string>
#include <vector>

#include "tools/log_review.h"
#include "tools/review_metrics.h"

namespace holdfast {

/// The review as one JSON object, indented by two; units stand in the keys or beside the values. A
/// number that is not known is null. Packets are counted by label, not listed.
std::string review_json(const RunReview& review);

/// Several reviews: {"logs": [one object each], "combined": [metrics over the logs of a scenario]}.
std::string reviews_json(const std::vector<RunReview>& reviews,
                         const std::vector<CombinedReview>& combined);

}  // namespace holdfast
