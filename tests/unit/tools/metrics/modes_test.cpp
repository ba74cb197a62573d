#include "tests/unit/tools/metrics/metric_cases.h"

namespace holdfast {
namespace {

using testing::kNan;
using testing::matrix_of;
using testing::metric;

}  // namespace

TEST_CASE("mode accuracy and delay of hand-made runs") {
  EstimatorRuns runs;
  // Changes: run 0 at the 3rd step (found at once), the 4th (found two later) and the 7th (never);
  // run 1 at the 4th, over a gap (found one later).
  runs.curves["mode"] = matrix_of(
      {{0.0, 0.0, 1.0, 2.0, 2.0, 2.0, 0.0, 0.0}, {5.0, 5.0, kNan, 6.0, 6.0, 6.0, 6.0, 6.0}});
  runs.curves["mode_correct"] = matrix_of(
      {{0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0}, {1.0, 1.0, kNan, 0.0, 1.0, 0.0, 1.0, 1.0}});
  const EstimatorMetrics metrics = compute_metrics(runs, {});
  const Metric& accuracy = metric(metrics, "mode_accuracy");
  CHECK(accuracy.value == Approx((3.0 / 8.0 + 5.0 / 7.0) / 2.0).epsilon(1e-15));
  CHECK(accuracy.count == 2);
  const Metric& delay = metric(metrics, "mode_delay");
  CHECK(delay.value == Approx((0.0 + 2.0 + 1.0) / 3.0).epsilon(1e-15));
  CHECK(delay.count == 3);
  CHECK(delay.unit == "steps");
  CHECK(metric(metrics, "mode_changes_found").value == 0.75);
  CHECK(metric(metrics, "mode_changes_found").count == 4);
}

TEST_CASE("a change that is not found before the next one is not found by the next one's success") {
  EstimatorRuns runs;
  runs.curves["mode"] = matrix_of({{0.0, 1.0, 1.0, 2.0}});
  runs.curves["mode_correct"] = matrix_of({{1.0, 0.0, 0.0, 1.0}});
  const EstimatorMetrics metrics = compute_metrics(runs, {});
  CHECK(metric(metrics, "mode_changes_found").value == 0.5);
  CHECK(metric(metrics, "mode_delay").value == 0.0);
}

TEST_CASE("without a change there is no delay, without modes nothing") {
  EstimatorRuns runs;
  runs.curves["mode"] = matrix_of({{3.0, 3.0}});
  runs.curves["mode_correct"] = matrix_of({{0.0, 1.0}});  // the first step is no change
  CHECK(metric(compute_metrics(runs, {}), "mode_accuracy").value == 0.5);
  CHECK(find_metric(compute_metrics(runs, {}), "mode_delay") == nullptr);
  CHECK(find_metric(compute_metrics(runs, {}), "mode_changes_found") == nullptr);
  CHECK(compute_metrics({}, {}).metrics.empty());
}

}  // namespace holdfast
