#include "tools/metrics/metrics.h"

#include <cmath>
#include <stdexcept>

#include "tools/metrics/metric_parts.h"

namespace holdfast {
namespace {

// The common shape of all curves, as a matrix without values.
struct Shape {
  std::size_t num_runs = 0, num_steps = 0;
  bool operator==(const Shape&) const = default;
};

Shape shape_of(const EstimatorRuns& runs) {
  Shape shape;
  bool is_known = false;
  const auto meet = [&](const std::string& name, const RunMatrix& matrix) {
    const Shape other{matrix.num_runs(), matrix.num_steps()};
    if (is_known && other != shape)
      throw std::invalid_argument("curve " + name + " of " + runs.estimator +
                                  " has other runs or steps than the others");
    shape = other;
    is_known = true;
  };
  for (const auto& [name, matrix] : runs.curves) meet(name, matrix);
  if (runs.is_attacked != nullptr) meet("is_attacked", *runs.is_attacked);
  if (runs.authentic_packets != nullptr) meet("authentic_packets", *runs.authentic_packets);
  return shape;
}

std::size_t resamples_of(const MetricsOptions& options) {
  if (options.num_resamples < 1) throw std::invalid_argument("the bootstrap needs a resample");
  return static_cast<std::size_t>(options.num_resamples);
}

}  // namespace

const RunMatrix* MetricsInput::find(const std::string& curve) const {
  const auto found = runs.curves.find(curve);
  return found == runs.curves.end() ? nullptr : &found->second;
}

void add_metric(EstimatorMetrics& result, const std::string& name, const std::string& group,
                const std::string& unit, const Statistic& statistic) {
  if (std::isnan(statistic.value)) return;
  result.metrics.push_back(
      {name, group, unit, statistic.value, statistic.standard_error, statistic.count});
}

MetricCurve mean_curve(const std::string& name, const RunMatrix& matrix) {
  MetricCurve curve;
  curve.name = name;
  std::vector<double> column(matrix.num_runs());
  for (std::size_t k = 0; k < matrix.num_steps(); ++k) {
    for (std::size_t r = 0; r < column.size(); ++r) column[r] = matrix.run(r)[k];
    const Statistic mean = mean_of(column);
    curve.value.push_back(mean.value);
    curve.standard_error.push_back(mean.standard_error);
  }
  return curve;
}

std::vector<double> run_means(const RunMatrix& matrix) {
  std::vector<double> means;
  for (std::size_t r = 0; r < matrix.num_runs(); ++r) means.push_back(mean_of(matrix.run(r)).value);
  return means;
}

std::vector<double> run_root_means(const RunMatrix& matrix) {
  std::vector<double> roots = run_means(matrix);
  for (double& value : roots) value = std::sqrt(value);
  return roots;
}

EstimatorMetrics compute_metrics(const EstimatorRuns& runs, const MetricsOptions& options) {
  EstimatorMetrics result;
  result.estimator = runs.estimator;
  result.outcomes = runs.outcomes;
  const RunBootstrap bootstrap(options.seed, shape_of(runs).num_runs, resamples_of(options));
  const MetricsInput input{runs, options, bootstrap};
  add_rmse(input, result);
  add_consistency(input, result);
  add_detection(input, result);
  add_modes(input, result);
  add_mixtures(input, result);
  add_windows(input, result);
  return result;
}

const Metric* find_metric(const EstimatorMetrics& estimator, const std::string& name,
                          const std::string& group) {
  for (const Metric& metric : estimator.metrics)
    if (metric.name == name && metric.group == group) return &metric;
  return nullptr;
}

const MetricCurve* find_curve(const EstimatorMetrics& estimator, const std::string& name,
                              const std::string& group) {
  for (const MetricCurve& curve : estimator.curves)
    if (curve.name == name && curve.group == group) return &curve;
  return nullptr;
}

}  // namespace holdfast
