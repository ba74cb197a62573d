#pragma once

#include <cstdint>
#include <holdfast/status_t.hpp>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/log_file.h"
#include "tools/log_review.h"

namespace holdfast {

/// One estimate.
struct Sample {
  std::int32_t outcome = 0;  // of estimate_t
  std::vector<double> mean, covariance;
};

/// What the events of one estimator leave behind.
struct EstimatorTrace {
  std::map<std::int64_t, Sample> samples;  // by step
  std::int64_t repeated = 0;
  std::vector<std::pair<std::int64_t, double>> packet_posteriors;  // rx_index, P(authentic)
  std::vector<double> compute_time_us, latency_us;
};

/// Everything that one pass over a log collects.
struct LogTrace {
  std::int64_t num_steps = 0;  // 0: the scenario does not say
  std::map<std::int64_t, std::vector<double>> truth;
  std::set<std::int64_t> measurement_steps;
  std::map<std::string, EstimatorTrace> estimators;  // by the channel's suffix
  std::map<std::string, status_t> statuses;          // newest, by channel
  std::map<std::pair<std::string, std::string>, RuleReview> rules;
  std::vector<PacketRow> packets;
  PacketLabeler labeler;
  std::int64_t frames_touched = 0;
  std::set<std::string> scenario_hashes;
  std::map<std::string, ChannelTrouble> troubles;
};

/// Reads all events. Whatever stands in them, it neither throws nor trusts: events that the guard
/// refuses and steps outside 1..num_steps (0: any) are counted by channel and left out.
LogTrace collect_trace(LogReader& reader, std::int64_t num_steps, std::int64_t& num_events);

}  // namespace holdfast
