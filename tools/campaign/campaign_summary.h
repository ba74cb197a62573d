#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "tools/campaign/campaign_store.h"
#include "tools/metrics/metrics.h"

namespace holdfast {

/// One estimator at one sweep point.
struct EstimatorSummary {
  EstimatorMetrics metrics;
  std::vector<PairedDifference> against_first;        // the scenario's first estimator, same runs
  std::vector<PairedDifference> against_first_point;  // itself at the first point, same runs
  TimeHistogram step_times;                           // no part of the aggregate
};

struct PointSummary {
  std::vector<std::string> settings;
  std::int64_t num_runs = 0, num_steps = 0;
  double attacked_share = 0.0;  // of all steps
  std::map<std::string, std::int64_t> counters;
  std::vector<EstimatorSummary> estimators;  // in the scenario's order
};

/// What a results file says. Depends only on the runs, never on how they were made.
struct CampaignSummary {
  std::string scenario, version, commit, kernel, identity;
  std::int64_t seed = 0;
  std::vector<PointSummary> points;
};

/// Computes every metric over the runs of the range. num_threads: 0 for as many as the processors
/// that this process may use; the result does not depend on it. Throws UsageError when a point has
/// no run.
CampaignSummary summarise(CampaignStore& store, RunRange range, int num_threads = 0);

/// The aggregate as JSON, curves included, without times: equal runs give equal bytes. A number
/// that is not known is null.
std::string to_json(const CampaignSummary& summary);

}  // namespace holdfast
