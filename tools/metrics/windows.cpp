#include "tools/metrics/windows.h"

#include <algorithm>
#include <cmath>

#include "tools/metrics/metric_parts.h"

namespace holdfast {
namespace {

constexpr const char* kSignalErrors = "attack_signal_squared_error";

// What a window leaves of one run.
bool is_in(const MetricsWindow& window, const RunMatrix* authentic, std::size_t run,
           std::size_t row) {
  const auto step = static_cast<std::int64_t>(row) + 1;
  if (step < window.first_step || step > window.last_step) return false;
  for (const auto& [from, to] : window.without) {
    if (step >= from && step <= to) return false;
  }
  if (window.fresh_steps < 0) return true;
  const std::int64_t first = step - window.fresh_steps;
  if (first < 1) return false;
  for (std::int64_t s = first; s <= step; ++s) {
    if (!(authentic->run(run)[static_cast<std::size_t>(s - 1)] > 0.0)) return false;
  }
  return true;
}

RunMatrix masked(const RunMatrix& matrix, const MetricsWindow& window, const RunMatrix* authentic) {
  RunMatrix left(matrix.num_runs(), matrix.num_steps(), kNoValue);
  for (std::size_t r = 0; r < matrix.num_runs(); ++r) {
    for (std::size_t k = 0; k < matrix.num_steps(); ++k) {
      if (is_in(window, authentic, r, k)) left.run(r)[k] = matrix.run(r)[k];
    }
  }
  return left;
}

// Share of alarms, or of missing ones, over the window's steps of one kind.
Statistic alarm_share(const RunMatrix& probability, const RunMatrix& is_attacked, bool of_attacked,
                      const MetricsInput& input) {
  std::vector<double> events(probability.num_runs()), steps(probability.num_runs());
  for (std::size_t r = 0; r < probability.num_runs(); ++r) {
    for (std::size_t k = 0; k < probability.num_steps(); ++k) {
      const double p = probability.run(r)[k], truth = is_attacked.run(r)[k];
      if (std::isnan(p) || std::isnan(truth) || (truth > 0.5) != of_attacked) continue;
      const bool is_alarm = p >= input.options.detection_threshold;
      steps[r] += 1.0;
      events[r] += is_alarm != of_attacked ? 1.0 : 0.0;
    }
  }
  return ratio_of(events, steps, input.bootstrap);
}

void add_window(const MetricsInput& input, const MetricsWindow& window, EstimatorMetrics& result) {
  const RunMatrix* authentic = input.runs.authentic_packets;
  if (window.fresh_steps >= 0 && authentic == nullptr) return;
  const std::string place = "@" + window.name;
  for (const StateGroup& group : input.options.groups) {
    const RunMatrix* squares = input.find("squared_error." + group.name);
    if (squares == nullptr) continue;
    const RunMatrix left = masked(*squares, window, authentic);
    add_metric(result, "rmse_over_time", group.name + place, group.unit,
               mean_of(run_root_means(left)));
    add_metric(result, "rmse_step_mean", group.name + place, group.unit,
               rmse_of_steps(left, input.bootstrap).mean);
  }
  for (const auto& [name, squares] : input.runs.curves) {
    if (!name.starts_with(kSignalErrors)) continue;
    const std::string rest = name.substr(std::string(kSignalErrors).size());
    add_metric(result, "attack_signal_rmse", (rest.empty() ? "" : rest.substr(1)) + place, "",
               mean_of(run_root_means(masked(squares, window, authentic))));
  }
  if (const RunMatrix* is_correct = input.find("mode_correct")) {
    add_metric(result, "mode_accuracy", place, "",
               mean_of(run_means(masked(*is_correct, window, authentic))));
  }
  const RunMatrix* probability = input.find("attack_probability");
  if (probability == nullptr || input.runs.is_attacked == nullptr) return;
  const RunMatrix left = masked(*probability, window, authentic);
  add_metric(result, "false_alarm_rate", place, "",
             alarm_share(left, *input.runs.is_attacked, false, input));
  add_metric(result, "missed_detection_rate", place, "",
             alarm_share(left, *input.runs.is_attacked, true, input));
}

}  // namespace

void add_windows(const MetricsInput& input, EstimatorMetrics& result) {
  for (const MetricsWindow& window : input.options.windows) add_window(input, window, result);
}

}  // namespace holdfast
