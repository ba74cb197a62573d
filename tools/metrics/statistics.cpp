#include "tools/metrics/statistics.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace holdfast {
namespace {

// Median of sorted values, each counted as often as its run was drawn.
double weighted_median(const std::vector<RunValue>& sorted,
                       std::span<const RunBootstrap::Weight> weights) {
  std::int64_t total = 0;
  for (const RunValue& v : sorted) total += weights[v.run];
  if (total == 0) return kNoValue;
  const std::int64_t low_rank = (total + 1) / 2, high_rank = total / 2 + 1;
  std::int64_t below = 0;
  double low = kNoValue;
  for (const RunValue& v : sorted) {
    below += weights[v.run];
    if (std::isnan(low) && below >= low_rank) low = v.value;
    if (below >= high_rank) return low_rank == high_rank ? v.value : 0.5 * (low + v.value);
  }
  return kNoValue;
}

}  // namespace

Statistic mean_of(std::span<const double> values) {
  Statistic result;
  double sum = 0.0;
  for (const double value : values) {
    if (std::isnan(value)) continue;
    sum += value;
    ++result.count;
  }
  if (result.count == 0) return result;
  const auto count = static_cast<double>(result.count);
  result.value = sum / count;
  if (result.count < 2) return result;
  double squares = 0.0;
  for (const double value : values) {
    if (!std::isnan(value)) squares += (value - result.value) * (value - result.value);
  }
  result.standard_error = std::sqrt(squares / (count - 1.0) / count);
  return result;
}

double median(std::vector<double> values) {
  std::erase_if(values, [](double value) { return std::isnan(value); });
  if (values.empty()) return kNoValue;
  const auto half = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), half, values.end());
  if (values.size() % 2 == 1) return *half;
  return 0.5 * (*std::max_element(values.begin(), half) + *half);
}

Statistic median_of(std::vector<RunValue> values, const RunBootstrap& bootstrap) {
  std::erase_if(values, [](const RunValue& v) { return std::isnan(v.value); });
  std::stable_sort(values.begin(), values.end(),
                   [](const RunValue& a, const RunValue& b) { return a.value < b.value; });
  Statistic result;
  result.count = static_cast<std::int64_t>(values.size());
  const std::vector<RunBootstrap::Weight> once(bootstrap.num_runs(), 1);
  result.value = weighted_median(values, once);
  std::set<std::size_t> runs;
  for (const RunValue& v : values) runs.insert(v.run);
  if (runs.size() < 2) return result;
  std::vector<double> resampled(bootstrap.num_resamples());
  for (std::size_t i = 0; i < resampled.size(); ++i)
    resampled[i] = weighted_median(values, bootstrap.weights(i));
  result.standard_error = bootstrap_error(resampled);
  return result;
}

Statistic ratio_of(std::span<const double> numerator, std::span<const double> denominator,
                   const RunBootstrap& bootstrap) {
  Statistic result;
  double above = 0.0, below = 0.0;
  std::size_t num_runs = 0;
  for (std::size_t r = 0; r < numerator.size(); ++r) {
    above += numerator[r];
    below += denominator[r];
    num_runs += denominator[r] > 0.0 ? 1 : 0;
  }
  result.count = std::llround(below);
  if (num_runs == 0) return result;
  result.value = above / below;
  if (num_runs < 2) return result;
  std::vector<double> resampled(bootstrap.num_resamples());
  for (std::size_t i = 0; i < resampled.size(); ++i) {
    const std::span<const RunBootstrap::Weight> weights = bootstrap.weights(i);
    above = below = 0.0;
    for (std::size_t r = 0; r < numerator.size(); ++r) {
      above += weights[r] * numerator[r];
      below += weights[r] * denominator[r];
    }
    resampled[i] = below > 0.0 ? above / below : kNoValue;
  }
  result.standard_error = bootstrap_error(resampled);
  return result;
}

}  // namespace holdfast
