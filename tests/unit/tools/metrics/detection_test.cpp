#include "tests/unit/tools/metrics/metric_cases.h"

namespace holdfast {
namespace {

using testing::kNan;
using testing::matrix_of;
using testing::metric;

using Row = std::vector<double>;

EstimatorMetrics metrics_of(const RunMatrix& probability, const RunMatrix* is_attacked) {
  EstimatorRuns runs;
  runs.curves["attack_probability"] = probability;
  runs.is_attacked = is_attacked;
  return compute_metrics(runs, {});
}

}  // namespace

TEST_CASE("each attack is met by its first alarm") {
  //                step:   1    2    3    4    5    6    7    8    9   10
  const Row is_attacked = {0.0, 1.0, 1.0, 1.0, 0.0, 1.0, 0.0, 1.0, 1.0, 1.0};
  const Row probability = {0.9, 0.1, 0.5, 0.9, 0.9, 0.4, 0.9, kNan, 0.7, 0.1};
  const std::vector<DetectionEvent> events = detection_events(probability, is_attacked, 0.5);
  REQUIRE(events.size() == 3);
  CHECK(events[0].first_step == 2);
  CHECK(events[0].last_step == 4);
  CHECK(events[0].detected_step == 3);  // at the threshold is an alarm
  CHECK(events[1].first_step == 6);
  CHECK(events[1].last_step == 6);
  CHECK(events[1].detected_step == -1);  // an alarm one step later is none for it
  CHECK(events[2].first_step == 8);
  CHECK(events[2].last_step == 10);
  CHECK(events[2].detected_step == 9);
  CHECK(detection_events({}, {}, 0.5).empty());
  // A truth that is not known ends an interval.
  CHECK(detection_events(Row(3, 0.9), Row{1.0, kNan, 1.0}, 0.5).size() == 2);
}

TEST_CASE("rates and delays of hand-made runs") {
  const RunMatrix is_attacked = matrix_of({{0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0},
                                           {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0},
                                           {1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 1.0, kNan}});
  const RunMatrix probability = matrix_of({{0.0, 0.0, 0.0, 0.8, 0.9, 0.0, 0.0, 0.0},
                                           {0.0, 0.6, 0.0, 0.0, 0.0, 0.0, 0.0, kNan},
                                           {0.7, 0.7, 0.1, 0.0, 0.0, 0.0, 0.9, 0.9}});
  const EstimatorMetrics metrics = metrics_of(probability, &is_attacked);
  const Metric& false_alarm = metric(metrics, "false_alarm_rate");
  CHECK(false_alarm.count == 3 + 7 + 1);
  CHECK(false_alarm.value == Approx(2.0 / 11.0).epsilon(1e-15));
  CHECK(false_alarm.standard_error > 0.0);
  const Metric& missed = metric(metrics, "missed_detection_rate");
  CHECK(missed.count == 5 + 6);
  CHECK(missed.value == Approx((4.0 + 3.0) / 11.0).epsilon(1e-15));
  const Metric& detected = metric(metrics, "attacks_detected");
  CHECK(detected.count == 4);
  CHECK(detected.value == 0.75);
  // Of the four attacks, one is met in its first step.
  CHECK(metric(metrics, "attacks_detected_at_once").value == 0.25);
  const Metric& delay = metric(metrics, "detection_delay");
  CHECK(delay.count == 3);
  CHECK(delay.value == Approx((2.0 + 0.0 + 3.0) / 3.0).epsilon(1e-15));
  CHECK(delay.unit == "steps");
  CHECK(metric(metrics, "detection_delay_median").value == 2.0);
}

TEST_CASE("a lower threshold alarms more") {
  const RunMatrix is_attacked = matrix_of({{0.0, 1.0}});
  EstimatorRuns runs;
  runs.curves["attack_probability"] = matrix_of({{0.3, 0.4}});
  runs.is_attacked = &is_attacked;
  MetricsOptions options;
  CHECK(metric(compute_metrics(runs, options), "false_alarm_rate").value == 0.0);
  CHECK(metric(compute_metrics(runs, options), "missed_detection_rate").value == 1.0);
  CHECK(find_metric(compute_metrics(runs, options), "detection_delay") == nullptr);
  options.detection_threshold = 0.3;
  CHECK(metric(compute_metrics(runs, options), "false_alarm_rate").value == 1.0);
  CHECK(metric(compute_metrics(runs, options), "missed_detection_rate").value == 0.0);
  CHECK(metric(compute_metrics(runs, options), "detection_delay").value == 0.0);
}

TEST_CASE("without attacks there are false alarms only, without their truth not even those") {
  const RunMatrix clean = matrix_of({{0.0, 0.0}}), probability = matrix_of({{0.9, 0.1}});
  const EstimatorMetrics metrics = metrics_of(probability, &clean);
  REQUIRE(metrics.metrics.size() == 1);
  CHECK(metrics.metrics[0].name == "false_alarm_rate");
  CHECK(metrics.metrics[0].value == 0.5);
  CHECK(std::isnan(metrics.metrics[0].standard_error));  // one run
  CHECK(metrics.rocs.empty());
  CHECK(metrics_of(probability, nullptr).metrics.empty());
}

TEST_CASE("a rate's error comes from runs, not from steps") {
  // In half of the runs every step alarms, in the others none: as many facts as runs.
  const RunMatrix clean = matrix_of(100, 50, [](std::size_t, std::size_t) { return 0.0; });
  const RunMatrix probability =
      matrix_of(100, 50, [](std::size_t r, std::size_t) { return r % 2 == 0 ? 1.0 : 0.0; });
  const Metric rate = metric(metrics_of(probability, &clean), "false_alarm_rate");
  CHECK(rate.value == 0.5);
  // Closed form sqrt(0.25 / 100); 400 resamples tell it to 3.5 %, four times that.
  CHECK(rate.standard_error == Approx(0.05).epsilon(0.14));
  CHECK(rate.standard_error != Approx(0.05 / std::sqrt(50.0)).epsilon(0.14));
}

TEST_CASE("attack-signal RMSE is over time in each run, then the mean over runs") {
  EstimatorRuns runs;
  runs.curves["attack_signal_squared_error"] = matrix_of({{1.0, 1.0}, {kNan, 9.0}});
  const EstimatorMetrics metrics = compute_metrics(runs, {});
  CHECK(metric(metrics, "attack_signal_rmse").value == 2.0);
  CHECK(metric(metrics, "attack_signal_rmse").standard_error == Approx(1.0).epsilon(1e-15));
}

}  // namespace holdfast
