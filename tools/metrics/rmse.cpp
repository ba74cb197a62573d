#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "tools/metrics/metric_parts.h"

namespace holdfast {
namespace {

// Mean and median over the steps of the RMSE over runs at each step.
struct StepSummary {
  double mean = kNoValue, median = kNoValue;
};

StepSummary summary_of(std::span<const double> mean_squares) {
  std::vector<double> rmse;
  double sum = 0.0;
  for (const double square : mean_squares) {
    if (std::isnan(square)) continue;
    rmse.push_back(std::sqrt(square));
    sum += rmse.back();
  }
  if (rmse.empty()) return {};
  const double mean = sum / static_cast<double>(rmse.size());
  return {mean, median(std::move(rmse))};
}

struct Resampled {
  std::vector<double> mean, median;  // [resample]
};

Resampled resample(StepMeans& squares, const RunBootstrap& bootstrap) {
  Resampled result;
  squares.for_each_resample(bootstrap, [&result](std::span<const double> mean_squares) {
    const StepSummary summary = summary_of(mean_squares);
    result.mean.push_back(summary.mean);
    result.median.push_back(summary.median);
  });
  return result;
}

void add_over_runs(const MetricsInput& input, const StateGroup& group, const RunMatrix& squares,
                   EstimatorMetrics& result) {
  StepRmse rmse = rmse_of_steps(squares, input.bootstrap);
  add_metric(result, "rmse_step_mean", group.name, group.unit, rmse.mean);
  add_metric(result, "rmse_step_median", group.name, group.unit, rmse.median);
  result.resampled_rmse[group.name] = {squares.num_runs(), squares.num_steps(),
                                       std::move(rmse.resampled_means)};
  MetricCurve curve = mean_curve("rmse_over_runs", squares);
  curve.group = group.name;
  curve.unit = group.unit;
  for (std::size_t k = 0; k < curve.value.size(); ++k) {
    curve.value[k] = std::sqrt(curve.value[k]);
    // Delta method: d sqrt(m) = dm / (2 sqrt(m)). Without any error there is no scatter either.
    if (curve.standard_error[k] > 0.0) curve.standard_error[k] /= 2.0 * curve.value[k];
  }
  result.curves.push_back(std::move(curve));
}

// 1 for a run whose RMSE over the last tenth of the steps is above the bound.
std::vector<double> lost_runs(const RunMatrix& squares, double bound) {
  const std::size_t num_last = std::max<std::size_t>(1, squares.num_steps() / 10);
  std::vector<double> is_lost;
  for (std::size_t r = 0; r < squares.num_runs(); ++r) {
    const double mean = mean_of(squares.run(r).last(num_last)).value;
    is_lost.push_back(std::isnan(mean) ? kNoValue : std::sqrt(mean) > bound ? 1.0 : 0.0);
  }
  return is_lost;
}

std::vector<double> missing_shares(const RunMatrix& matrix) {
  std::vector<double> shares;
  for (std::size_t r = 0; r < matrix.num_runs(); ++r) {
    const auto run = matrix.run(r);
    const auto missing =
        std::count_if(run.begin(), run.end(), [](double value) { return std::isnan(value); });
    shares.push_back(static_cast<double>(missing) / static_cast<double>(run.size()));
  }
  return shares;
}

void add_group(const MetricsInput& input, const StateGroup& group, const RunMatrix& squares,
               EstimatorMetrics& result) {
  const std::vector<double> over_time = run_root_means(squares);
  add_metric(result, "rmse_over_time", group.name, group.unit, mean_of(over_time));
  std::vector<RunValue> values;
  for (std::size_t r = 0; r < over_time.size(); ++r) values.push_back({r, over_time[r]});
  add_metric(result, "rmse_over_time_median", group.name, group.unit,
             median_of(std::move(values), input.bootstrap));
  add_over_runs(input, group, squares, result);
  if (group.lost_above > 0.0) {
    add_metric(result, "lost_share", group.name, "", mean_of(lost_runs(squares, group.lost_above)));
  }
  const Statistic missing = mean_of(missing_shares(squares));
  if (missing.value > 0.0) add_metric(result, "missing_share", group.name, "", missing);
}

}  // namespace

StepRmse rmse_of_steps(const RunMatrix& squares, const RunBootstrap& bootstrap) {
  StepMeans means(squares);
  const StepSummary summary = summary_of(means.mean());
  StepRmse rmse;
  rmse.mean.value = summary.mean;
  rmse.median.value = summary.median;
  rmse.mean.count = rmse.median.count = static_cast<std::int64_t>(means.num_runs_with_values());
  if (rmse.mean.count >= 2) {
    Resampled resampled = resample(means, bootstrap);
    rmse.mean.standard_error = bootstrap_error(resampled.mean);
    rmse.median.standard_error = bootstrap_error(resampled.median);
    rmse.resampled_means = std::move(resampled.mean);
  }
  return rmse;
}

void add_rmse(const MetricsInput& input, EstimatorMetrics& result) {
  for (const StateGroup& group : input.options.groups) {
    const RunMatrix* squares = input.find("squared_error." + group.name);
    if (squares != nullptr && squares->num_steps() > 0) add_group(input, group, *squares, result);
  }
}

std::vector<PairedDifference> paired_differences(const EstimatorMetrics& ours,
                                                 const EstimatorMetrics& reference,
                                                 const MetricsOptions& options) {
  std::vector<PairedDifference> differences;
  for (const StateGroup& group : options.groups) {
    const std::string name = "rmse_step_mean";
    const auto a = ours.resampled_rmse.find(group.name),
               b = reference.resampled_rmse.find(group.name);
    if (a == ours.resampled_rmse.end() || b == reference.resampled_rmse.end()) continue;
    if (a->second.num_runs != b->second.num_runs || a->second.num_steps != b->second.num_steps) {
      throw std::invalid_argument(ours.estimator + " and " + reference.estimator +
                                  " have different runs or steps");
    }
    const Metric* const our_mean = find_metric(ours, name, group.name);
    const Metric* const their_mean = find_metric(reference, name, group.name);
    if (our_mean == nullptr || their_mean == nullptr) continue;
    if (!std::isfinite(our_mean->value - their_mean->value)) continue;
    PairedDifference difference{ours.estimator, reference.estimator,
                                name,           group.name,
                                group.unit,     our_mean->value - their_mean->value,
                                kNoValue};
    std::vector<double> resampled = a->second.values;
    const std::vector<double>& others = b->second.values;
    if (!resampled.empty() && !others.empty()) {
      if (resampled.size() != others.size())
        throw std::invalid_argument(ours.estimator + " and " + reference.estimator +
                                    " have different numbers of resamples");
      for (std::size_t i = 0; i < resampled.size(); ++i) resampled[i] -= others[i];
      difference.standard_error = bootstrap_error(resampled);
    }
    differences.push_back(std::move(difference));
  }
  return differences;
}

}  // namespace holdfast
