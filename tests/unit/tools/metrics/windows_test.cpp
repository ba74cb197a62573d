#include "tests/unit/tools/metrics/metric_cases.h"

namespace holdfast {
namespace {

using testing::kNan;
using testing::matrix_of;

// Two runs of six steps; the attack lasts from step 3 on.
struct Case {
  RunMatrix is_attacked = matrix_of({{0, 0, 1, 1, 1, 1}, {0, 0, 1, 1, 1, 1}});
  RunMatrix authentic = matrix_of({{1, 1, 0, 1, 1, 1}, {1, 1, 1, 1, 2, 0}});
  EstimatorRuns runs;
  MetricsOptions options;

  Case() {
    runs.curves["squared_error.angle"] = matrix_of({{1, 4, 9, 16, 25, 36}, {4, 4, 4, 4, 4, kNan}});
    runs.curves["attack_signal_squared_error"] =
        matrix_of({{1, 1, 1, 4, 4, 4}, {9, 9, 9, 9, 9, 9}});
    runs.curves["attack_signal_squared_error.2"] =
        matrix_of({{0, 0, 0, 1, 1, 1}, {4, 4, 4, 4, 4, 4}});
    runs.curves["attack_probability"] =
        matrix_of({{0.9, 0, 0, 0.9, 0.9, 0}, {0, 0, 0.9, 0.9, 0, 0.9}});
    runs.is_attacked = &is_attacked;
    options.groups = {{"angle", {0}, "rad", 0.0}};
  }

  double value(const std::string& name, const std::string& group) const {
    const EstimatorMetrics metrics = compute_metrics(runs, options);
    const Metric* found = find_metric(metrics, name, group);
    return found == nullptr ? kNan : found->value;
  }
};

}  // namespace

TEST_CASE("a window's metrics are those of its steps alone") {
  Case c;
  c.options.windows = {{"early", 1, 2, -1}, {"late", 3, 6, -1}};
  CHECK(c.value("rmse_over_time", "angle@early") ==
        Approx((std::sqrt(2.5) + 2.0) / 2.0).epsilon(1e-14));
  CHECK(c.value("rmse_over_time", "angle@late") ==
        Approx((std::sqrt(86.0 / 4.0) + 2.0) / 2.0).epsilon(1e-14));
  CHECK(c.value("attack_signal_rmse", "@late") ==
        Approx((std::sqrt(13.0 / 4.0) + 3.0) / 2.0).epsilon(1e-14));
  CHECK(c.value("attack_signal_rmse", "2@early") == Approx(1.0));
  CHECK(c.value("false_alarm_rate", "@early") == Approx(0.25));
  CHECK(c.value("missed_detection_rate", "@late") == Approx(3.0 / 8.0));
  // No step of the late window is free of attack, none of the early one attacked.
  CHECK(std::isnan(c.value("false_alarm_rate", "@late")));
  CHECK(std::isnan(c.value("missed_detection_rate", "@early")));
}

TEST_CASE("a window leaves out the stretches that it is without") {
  Case c;
  c.options.windows = {{"quiet", 1, 6, -1, {{2, 3}, {5, 5}}}, {"nothing", 2, 3, -1, {{1, 6}}}};
  // Run 1 has the squares 1, 16, 36; run 2 has 4 and 4, its last being unknown.
  CHECK(c.value("rmse_over_time", "angle@quiet") ==
        Approx((std::sqrt(53.0 / 3.0) + 2.0) / 2.0).epsilon(1e-14));
  CHECK(std::isnan(c.value("rmse_over_time", "angle@nothing")));
}

TEST_CASE("a fresh window leaves out steps after a loss") {
  Case c;
  c.options.windows = {{"fresh", 3, 6, 1}};
  // Without knowledge of the packets there is no such window.
  CHECK(std::isnan(c.value("rmse_over_time", "angle@fresh")));
  c.runs.authentic_packets = &c.authentic;
  // Run 1 has steps 5 and 6 (3 was lost, 4 follows a loss); run 2 has 3, 4, 5.
  CHECK(c.value("rmse_over_time", "angle@fresh") ==
        Approx((std::sqrt(61.0 / 2.0) + 2.0) / 2.0).epsilon(1e-14));
  CHECK(c.value("missed_detection_rate", "@fresh") == Approx(2.0 / 5.0));
  // A window that asks for more than the run has behind it leaves nothing.
  c.options.windows = {{"fresh", 1, 2, 5}};
  CHECK(std::isnan(c.value("rmse_over_time", "angle@fresh")));
}

}  // namespace holdfast
