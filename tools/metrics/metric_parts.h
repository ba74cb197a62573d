#pragma once

#include <string>
#include <vector>

#include "tools/metrics/metrics.h"
#include "tools/metrics/statistics.h"

namespace holdfast {

/// What each part of compute_metrics works on. Parts append to the result what the curves allow.
struct MetricsInput {
  const EstimatorRuns& runs;
  const MetricsOptions& options;
  const RunBootstrap& bootstrap;

  const RunMatrix* find(const std::string& curve) const;  // null when there is none
};

void add_rmse(const MetricsInput& input, EstimatorMetrics& result);
void add_consistency(const MetricsInput& input, EstimatorMetrics& result);
void add_detection(const MetricsInput& input, EstimatorMetrics& result);
void add_modes(const MetricsInput& input, EstimatorMetrics& result);
void add_mixtures(const MetricsInput& input, EstimatorMetrics& result);
void add_windows(const MetricsInput& input, EstimatorMetrics& result);

/// Appends the metric unless it has no value.
void add_metric(EstimatorMetrics& result, const std::string& name, const std::string& group,
                const std::string& unit, const Statistic& statistic);
/// Mean over runs at each step, with its standard error.
MetricCurve mean_curve(const std::string& name, const RunMatrix& matrix);
/// Mean over steps of each run; NaN for a run without values.
std::vector<double> run_means(const RunMatrix& matrix);
/// sqrt(run_means).
std::vector<double> run_root_means(const RunMatrix& matrix);

/// Mean and median over the steps of the RMSE over runs at each step, from squared errors.
struct StepRmse {
  Statistic mean, median;
  std::vector<double> resampled_means;  // empty when fewer than two runs have values
};
StepRmse rmse_of_steps(const RunMatrix& squares, const RunBootstrap& bootstrap);

}  // namespace holdfast
