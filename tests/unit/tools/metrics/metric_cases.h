#pragma once

#include <cmath>
#include <functional>
#include <stdexcept>
#include <string>

#include "common/random_stream.h"
#include "tests/support/catch.h"
#include "tools/metrics/metrics.h"

namespace holdfast::testing {

inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

inline RunMatrix matrix_of(const std::vector<std::vector<double>>& rows) {
  RunMatrix matrix(rows.size(), rows.empty() ? 0 : rows[0].size(), kNan);
  for (std::size_t r = 0; r < rows.size(); ++r)
    std::copy(rows[r].begin(), rows[r].end(), matrix.run(r).begin());
  return matrix;
}

inline RunMatrix matrix_of(std::size_t num_runs, std::size_t num_steps,
                           const std::function<double(std::size_t, std::size_t)>& value) {
  RunMatrix matrix(num_runs, num_steps, kNan);
  for (std::size_t r = 0; r < num_runs; ++r) {
    for (std::size_t k = 0; k < num_steps; ++k) matrix.run(r)[k] = value(r, k);
  }
  return matrix;
}

inline const Metric& metric(const EstimatorMetrics& metrics, const std::string& name,
                            const std::string& group = "") {
  const Metric* found = find_metric(metrics, name, group);
  if (found == nullptr) throw std::runtime_error("no metric " + name + " " + group);
  return *found;
}

inline const MetricCurve& curve(const EstimatorMetrics& metrics, const std::string& name) {
  for (const MetricCurve& found : metrics.curves) {
    if (found.name == name) return found;
  }
  throw std::runtime_error("no curve " + name);
}

inline MetricsOptions options_with(std::vector<StateGroup> groups = {}) {
  MetricsOptions options;
  options.groups = std::move(groups);
  return options;
}

/// Standard normal draws addressed by (run, step, draw).
inline double normal(std::size_t run, std::size_t step, std::uint64_t draw,
                     std::string_view name = "test/metrics") {
  return RandomStream(1, static_cast<std::uint32_t>(run), name)
      .normal(static_cast<std::uint32_t>(step), draw);
}

inline double uniform(std::size_t run, std::size_t step, std::uint64_t draw) {
  return RandomStream(1, static_cast<std::uint32_t>(run), "test/metrics")
      .uniform(static_cast<std::uint32_t>(step), draw);
}

}  // namespace holdfast::testing
