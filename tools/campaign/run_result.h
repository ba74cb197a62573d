#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "tools/experiment.h"
#include "tools/metrics/metrics.h"
#include "tools/metrics/step_times.h"

namespace holdfast {

/// What one run leaves behind of one estimator.
struct EstimatorResult {
  std::string name;
  RunScores scores;
  std::vector<DetectionEvent> detections;
  TimeHistogram step_times;  // differs from machine to machine: no part of any aggregate
};

/// What one run of one sweep point leaves behind.
struct RunResult {
  std::int64_t point = 0, run = 0;
  std::vector<double> is_attacked;        // [num_steps], 1 or 0
  std::vector<double> authentic_packets;  // [num_steps], how many; empty when nobody asks
  std::map<std::string, std::int64_t> counters;
  std::vector<EstimatorResult> estimators;
};

/// Runs one run of an experiment in process and scores every estimator of ours.
RunResult simulate_run(const Experiment& experiment, std::int64_t point, std::int64_t run);

/// The result as bytes, for other processes of the same build.
std::vector<std::uint8_t> to_bytes(const RunResult& result);
/// Throws JobError when the bytes are none.
RunResult run_result_from(std::span<const std::uint8_t> bytes);

/// Doubles as bytes, least significant first, and back.
std::vector<std::uint8_t> bytes_of(std::span<const double> values);
std::vector<double> doubles_of(std::span<const std::uint8_t> bytes);
/// Bins that hold something, as (bin, positives, negatives).
std::vector<std::uint8_t> bytes_of(const ScoreHistogram& histogram);
ScoreHistogram score_histogram_of(std::span<const std::uint8_t> bytes);
/// The longest time in ns, then (bucket, count) of those that hold something.
std::vector<std::uint8_t> bytes_of(const TimeHistogram& histogram);
TimeHistogram time_histogram_of(std::span<const std::uint8_t> bytes);

}  // namespace holdfast
