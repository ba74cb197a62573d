#include <cmath>

#include "common/chi_square.h"
#include "tools/metrics/metric_parts.h"

namespace holdfast {
namespace {

// Band of the mean over runs at each step: the sum over the runs that have a value is chi-square
// with the sum of their rows as degrees of freedom.
void add_band(const RunMatrix& values, const RunMatrix& rows, double probability,
              MetricCurve& curve) {
  double known_degrees = 0.0, known_low = kNoValue, known_high = kNoValue;
  for (std::size_t k = 0; k < values.num_steps(); ++k) {
    double degrees = 0.0, count = 0.0;
    for (std::size_t r = 0; r < values.num_runs(); ++r) {
      if (std::isnan(values.run(r)[k]) || std::isnan(rows.run(r)[k])) continue;
      degrees += rows.run(r)[k];
      count += 1.0;
    }
    // Mostly all steps have the same: a quantile costs microseconds.
    if (degrees != known_degrees && degrees > 0.0) {
      known_degrees = degrees;
      known_low = chi_square_quantile((1.0 - probability) / 2.0, degrees);
      known_high = chi_square_quantile((1.0 + probability) / 2.0, degrees);
    }
    curve.low.push_back(degrees > 0.0 ? known_low / count : kNoValue);
    curve.high.push_back(degrees > 0.0 ? known_high / count : kNoValue);
  }
}

double share_in_band(std::span<const double> means, const MetricCurve& band,
                     std::int64_t* num_steps = nullptr) {
  double inside = 0.0, count = 0.0;
  for (std::size_t k = 0; k < means.size(); ++k) {
    if (std::isnan(means[k]) || std::isnan(band.low[k])) continue;
    inside += means[k] >= band.low[k] && means[k] <= band.high[k] ? 1.0 : 0.0;
    count += 1.0;
  }
  if (num_steps != nullptr) *num_steps = std::llround(count);
  return inside / count;
}

Statistic in_band(const RunMatrix& values, const MetricCurve& band, const RunBootstrap& bootstrap) {
  Statistic share;
  share.value = share_in_band(band.value, band, &share.count);
  StepMeans means(values);
  if (means.num_runs_with_values() < 2) return share;
  std::vector<double> resampled;
  means.for_each_resample(bootstrap, [&](std::span<const double> row) {
    resampled.push_back(share_in_band(row, band));
  });
  share.standard_error = bootstrap_error(resampled);
  return share;
}

void add_one(const MetricsInput& input, const std::string& name, EstimatorMetrics& result) {
  const RunMatrix* values = input.find(name);
  if (values == nullptr) return;
  add_metric(result, name + "_mean", "", "", mean_of(run_means(*values)));
  MetricCurve curve = mean_curve(name, *values);
  if (const RunMatrix* rows = input.find(name + "_rows")) {
    add_metric(result, name + "_expected", "", "", mean_of(run_means(*rows)));
    add_band(*values, *rows, input.options.band_probability, curve);
    add_metric(result, name + "_in_band", "", "", in_band(*values, curve, input.bootstrap));
  }
  result.curves.push_back(std::move(curve));
}

}  // namespace

void add_consistency(const MetricsInput& input, EstimatorMetrics& result) {
  add_one(input, "nees", result);
  add_one(input, "nis", result);
}

}  // namespace holdfast
