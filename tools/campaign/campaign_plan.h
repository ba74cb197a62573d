#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "tools/experiment.h"

namespace holdfast {

/// One variation of the scenario.
struct CampaignPoint {
  std::vector<std::string> settings;  // "key=value"
  Experiment experiment;
};

/// What a campaign is to do: runs x points.
struct CampaignPlan {
  std::string scenario;  // name
  std::vector<CampaignPoint> points;
  std::int64_t first_run = 0, num_runs = 0;
  int shard = 1, num_shards = 1;  // this one takes every num_shards-th run

  /// Jobs of this shard, run by run, so that all points grow together; (point, run).
  std::vector<std::pair<std::int64_t, std::int64_t>> jobs() const;
  /// Numeric kernels of all points; equal bits are promised for equal kernels only.
  std::string kernel_text() const;
  /// Throws UsageError when a point's curves would not fit into memory for the summary.
  void check_size() const;
  /// Hash of what the results depend on: every point's resolved scenario, version, commit, kernel.
  std::string identity() const;
};

/// Reads the scenario once for each point of its sweep. Throws UsageError, which names the point,
/// when one is no valid scenario, or has no estimator that could run in process.
///
/// sweep: instead of the scenario's own, when it is not empty.
CampaignPlan load_campaign_plan(const std::string& file, const std::vector<std::string>& overrides,
                                const Sweep& sweep);

/// The plan as bytes, for other processes of the same build, and back. Throws JobError when this
/// process would compute with another kernel.
std::vector<std::uint8_t> to_bytes(const CampaignPlan& plan);
CampaignPlan campaign_plan_from(const std::vector<std::uint8_t>& bytes);

}  // namespace holdfast
