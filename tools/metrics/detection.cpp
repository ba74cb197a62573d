#include <cmath>

#include "tools/metrics/metric_parts.h"
#include "tools/metrics/roc.h"

namespace holdfast {
namespace {

// Sums of each run.
struct RunCounts {
  explicit RunCounts(std::size_t num_runs)
      : clean(num_runs),
        false_alarms(num_runs),
        attacked(num_runs),
        misses(num_runs),
        attacks(num_runs),
        detected(num_runs),
        at_once(num_runs),
        delay(num_runs) {}

  std::vector<double> clean, false_alarms;  // steps
  std::vector<double> attacked, misses;     // steps
  std::vector<double> attacks, detected;    // intervals
  std::vector<double> at_once;              // intervals detected in their first step
  std::vector<double> delay;                // steps, summed over detected attacks
  std::vector<RunValue> delays;
};

void count_run(std::size_t run, std::span<const double> probability,
               std::span<const double> is_attacked, double threshold, RunCounts& counts) {
  for (std::size_t k = 0; k < probability.size(); ++k) {
    if (std::isnan(probability[k]) || std::isnan(is_attacked[k])) continue;
    const bool is_alarm = probability[k] >= threshold;
    if (is_attacked[k] > 0.5) {
      counts.attacked[run] += 1.0;
      counts.misses[run] += is_alarm ? 0.0 : 1.0;
    } else {
      counts.clean[run] += 1.0;
      counts.false_alarms[run] += is_alarm ? 1.0 : 0.0;
    }
  }
  for (const DetectionEvent& event : detection_events(probability, is_attacked, threshold)) {
    counts.attacks[run] += 1.0;
    if (event.detected_step < 0) continue;
    const auto delay = static_cast<double>(event.detected_step - event.first_step);
    counts.detected[run] += 1.0;
    counts.at_once[run] += delay == 0.0 ? 1.0 : 0.0;
    counts.delay[run] += delay;
    counts.delays.push_back({run, delay});
  }
}

void add_roc(const Roc& roc, const std::string& name, EstimatorMetrics& result) {
  if (std::isnan(roc.area.value)) return;
  add_metric(result, "auc_" + name, "", "", roc.area);
  result.rocs.push_back(roc.curve);
  result.rocs.back().name = name;
}

Roc roc_of_steps(const RunMatrix& probability, const RunMatrix& is_attacked) {
  std::vector<RunScore> scores;
  for (std::size_t r = 0; r < probability.num_runs(); ++r) {
    for (std::size_t k = 0; k < probability.num_steps(); ++k) {
      const double score = probability.run(r)[k], truth = is_attacked.run(r)[k];
      if (!std::isnan(score) && !std::isnan(truth))
        scores.push_back({score, static_cast<std::uint32_t>(r), truth > 0.5});
    }
  }
  return roc_of_scores(std::move(scores), probability.num_runs());
}

void add_steps(const MetricsInput& input, const RunMatrix& probability,
               const RunMatrix& is_attacked, EstimatorMetrics& result) {
  RunCounts counts(probability.num_runs());
  for (std::size_t r = 0; r < probability.num_runs(); ++r) {
    count_run(r, probability.run(r), is_attacked.run(r), input.options.detection_threshold, counts);
  }
  const RunBootstrap& bootstrap = input.bootstrap;
  add_metric(result, "false_alarm_rate", "", "",
             ratio_of(counts.false_alarms, counts.clean, bootstrap));
  add_metric(result, "missed_detection_rate", "", "",
             ratio_of(counts.misses, counts.attacked, bootstrap));
  add_metric(result, "attacks_detected", "", "",
             ratio_of(counts.detected, counts.attacks, bootstrap));
  add_metric(result, "attacks_detected_at_once", "", "",
             ratio_of(counts.at_once, counts.attacks, bootstrap));
  add_metric(result, "detection_delay", "", "steps",
             ratio_of(counts.delay, counts.detected, bootstrap));
  add_metric(result, "detection_delay_median", "", "steps",
             median_of(std::move(counts.delays), bootstrap));
  add_roc(roc_of_steps(probability, is_attacked), "steps", result);
}

}  // namespace

std::vector<DetectionEvent> detection_events(std::span<const double> attack_probability,
                                             std::span<const double> is_attacked,
                                             double threshold) {
  std::vector<DetectionEvent> events;
  bool was_attacked = false;
  for (std::size_t k = 0; k < is_attacked.size(); ++k) {
    const auto step = static_cast<std::int64_t>(k) + 1;
    const bool is_now = is_attacked[k] > 0.5;
    if (is_now && !was_attacked) events.push_back({step, step, -1});
    was_attacked = is_now;
    if (!is_now) continue;
    DetectionEvent& event = events.back();
    event.last_step = step;
    if (event.detected_step < 0 && attack_probability[k] >= threshold) event.detected_step = step;
  }
  return events;
}

void add_detection(const MetricsInput& input, EstimatorMetrics& result) {
  if (const RunMatrix* probability = input.find("attack_probability")) {
    result.curves.push_back(mean_curve("attack_probability", *probability));
    if (input.runs.is_attacked != nullptr)
      add_steps(input, *probability, *input.runs.is_attacked, result);
  }
  add_roc(roc_of_histogram(input.runs.packets, input.runs.packets_of_runs), "packets", result);
  const std::string errors = "attack_signal_squared_error";
  for (const auto& [name, squares] : input.runs.curves) {
    if (!name.starts_with(errors)) continue;
    const std::string channel = name.size() > errors.size() ? name.substr(errors.size() + 1) : "";
    add_metric(result, "attack_signal_rmse", channel, "", mean_of(run_root_means(squares)));
    MetricCurve curve = mean_curve("attack_signal_rmse", squares);
    for (std::size_t k = 0; k < curve.value.size(); ++k) {
      curve.value[k] = std::sqrt(curve.value[k]);
      if (curve.standard_error[k] > 0.0) curve.standard_error[k] /= 2.0 * curve.value[k];
    }
    curve.group = channel;
    result.curves.push_back(std::move(curve));
  }
}

}  // namespace holdfast
