#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "tools/metrics/metric_parts.h"

namespace holdfast {
namespace {

// Mean and median over the steps of the RMSE over runs at each step.
struct StepSummary {
  double mean = kNoValue, median = kNoValue;
};

StepSummary summary_of(const std::vector<double>& mean_squares) {
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

Resampled resample(StepMeans& squares, std::size_t num_steps, const RunBootstrap& bootstrap) {
  Resampled result;
  std::vector<double> mean_squares(num_steps);
  for (std::size_t i = 0; i < bootstrap.num_resamples(); ++i) {
    squares.mean(bootstrap.weights(i), mean_squares);
    const StepSummary summary = summary_of(mean_squares);
    result.mean.push_back(summary.mean);
    result.median.push_back(summary.median);
  }
  return result;
}

void add_over_runs(const MetricsInput& input, const StateGroup& group, const RunMatrix& squares,
                   EstimatorMetrics& result) {
  const StepRmse rmse = rmse_of_steps(squares, input.bootstrap);
  add_metric(result, "rmse_step_mean", group.name, group.unit, rmse.mean);
  add_metric(result, "rmse_step_median", group.name, group.unit, rmse.median);
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
    const Resampled resampled = resample(means, squares.num_steps(), bootstrap);
    rmse.mean.standard_error = bootstrap_error(resampled.mean);
    rmse.median.standard_error = bootstrap_error(resampled.median);
  }
  return rmse;
}

void add_rmse(const MetricsInput& input, EstimatorMetrics& result) {
  for (const StateGroup& group : input.options.groups) {
    const RunMatrix* squares = input.find("squared_error." + group.name);
    if (squares != nullptr && squares->num_steps() > 0) add_group(input, group, *squares, result);
  }
}

std::vector<PairedDifference> paired_differences(const EstimatorRuns& runs,
                                                 const EstimatorRuns& reference,
                                                 const MetricsOptions& options) {
  std::vector<PairedDifference> differences;
  for (const StateGroup& group : options.groups) {
    const std::string name = "squared_error." + group.name;
    const auto ours = runs.curves.find(name), theirs = reference.curves.find(name);
    if (ours == runs.curves.end() || theirs == reference.curves.end()) continue;
    const RunMatrix &a = ours->second, &b = theirs->second;
    if (a.num_runs() != b.num_runs() || a.num_steps() != b.num_steps()) {
      throw std::invalid_argument(runs.estimator + " and " + reference.estimator +
                                  " have different runs or steps");
    }
    StepMeans our_means(a), their_means(b);
    PairedDifference difference{runs.estimator, reference.estimator, "rmse_step_mean",
                                group.name,     group.unit,          kNoValue,
                                kNoValue};
    difference.value = summary_of(our_means.mean()).mean - summary_of(their_means.mean()).mean;
    if (std::isnan(difference.value)) continue;
    if (std::min(our_means.num_runs_with_values(), their_means.num_runs_with_values()) >= 2) {
      const RunBootstrap bootstrap(options.seed, a.num_runs(),
                                   static_cast<std::size_t>(options.num_resamples));
      std::vector<double> resampled = resample(our_means, a.num_steps(), bootstrap).mean;
      const std::vector<double> others = resample(their_means, b.num_steps(), bootstrap).mean;
      for (std::size_t i = 0; i < resampled.size(); ++i) resampled[i] -= others[i];
      difference.standard_error = bootstrap_error(resampled);
    }
    differences.push_back(std::move(difference));
  }
  return differences;
}

}  // namespace holdfast
