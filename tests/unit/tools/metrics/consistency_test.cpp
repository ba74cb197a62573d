#include <Eigen/Cholesky>

#include "tests/unit/tools/metrics/metric_cases.h"

namespace holdfast {
namespace {

using testing::curve;
using testing::metric;

constexpr std::size_t kNumSteps = 50;

// A filter whose errors have covariance P and which says `honesty` P; innovations likewise, with
// one to three rows.
EstimatorRuns filter_runs(std::size_t num_runs, double honesty) {
  Eigen::Matrix4d root;
  root << 2.0, 0.0, 0.0, 0.0, 1.0, 0.5, 0.0, 0.0, -1.0, 0.3, 3.0, 0.0, 0.2, 0.0, 1.0, 0.1;
  const Eigen::Matrix4d P = root * root.transpose();
  const std::vector<double> truth(4, 0.0);
  EstimatorRuns runs;
  for (const char* name : {"nees", "nees_rows", "nis", "nis_rows"})
    runs.curves[name] = RunMatrix(num_runs, kNumSteps, testing::kNan);
  for (std::size_t r = 0; r < num_runs; ++r) {
    RunScorer scorer({}, kNumSteps);
    for (std::size_t k = 0; k < kNumSteps; ++k) {
      Estimate estimate;
      estimate.step = static_cast<std::int64_t>(k) + 1;
      Eigen::VectorXd white(7);
      for (Eigen::Index i = 0; i < 7; ++i)
        white[i] = testing::normal(r, k, static_cast<std::uint64_t>(i));
      estimate.mean = root * white.head(4);
      estimate.covariance = honesty * P;
      const auto rows = static_cast<Eigen::Index>(1 + (r + k) % 3);
      estimate.innovation = white.segment(4, rows);
      estimate.innovation_covariance = honesty * Eigen::MatrixXd::Identity(rows, rows);
      scorer.take(estimate, {truth, 0, false, {}});
    }
    const RunScores scores = scorer.finish();
    for (auto& [name, matrix] : runs.curves) {
      const std::vector<double>& values = scores.curves.at(name);
      std::copy(values.begin(), values.end(), matrix.run(r).begin());
    }
  }
  return runs;
}

}  // namespace

TEST_CASE("an honest filter's NEES and NIS lie in their bands, a modest one's do not") {
  const EstimatorMetrics honest = compute_metrics(filter_runs(200, 1.0), {});
  const EstimatorMetrics modest = compute_metrics(filter_runs(200, 1.3), {});
  for (const std::string name : {"nees", "nis"}) {
    const double rows = name == "nees" ? 4.0 : 2.0;  // of one, two and three rows: two
    const Metric& mean = metric(honest, name + "_mean");
    CHECK(metric(honest, name + "_expected").value == Approx(rows).epsilon(0.01));
    // Variance of chi-square: 2 rows. Two-sided 4 sigma.
    const double error = std::sqrt(2.0 * rows / (200.0 * kNumSteps));
    CHECK(mean.value == Approx(rows).margin(4.0 * error + 0.01));
    CHECK(mean.count == 200);
    CHECK(mean.standard_error == Approx(error).epsilon(0.25));  // 4 / sqrt(2 200) = 0.2
    CHECK(metric(modest, name + "_mean").value != Approx(rows).margin(4.0 * error + 0.01));
    // 50 independent steps, each inside with probability 0.95: 39 or fewer has probability 3e-5.
    const Metric& inside = metric(honest, name + "_in_band");
    CHECK(inside.count == 50);
    CHECK(inside.value * 50.0 > 39.5);
    CHECK(metric(modest, name + "_in_band").value * 50.0 < 39.5);
    CHECK(inside.standard_error > 0.0);
    CHECK(curve(honest, name).low[7] < rows);
    CHECK(curve(honest, name).high[7] > rows);
  }
}

TEST_CASE("one run's NEES is held against the band of one") {
  const EstimatorMetrics metrics = compute_metrics(filter_runs(1, 1.0), {});
  const MetricCurve& nees = curve(metrics, "nees");
  CHECK(nees.low[0] == Approx(0.4844185571).epsilon(1e-8));
  CHECK(nees.high[0] == Approx(11.14328678).epsilon(1e-8));
  CHECK(metric(metrics, "nees_in_band").value * 50.0 > 39.5);
  CHECK(std::isnan(metric(metrics, "nees_in_band").standard_error));
  // Negative control: far too sure of itself.
  CHECK(metric(compute_metrics(filter_runs(1, 0.1), {}), "nees_in_band").value * 50.0 < 39.5);
}

TEST_CASE("the band follows the runs and rows of each step, and the probability asked for") {
  EstimatorRuns runs;
  runs.curves["nis"] =
      testing::matrix_of({{1.0, 1.0, testing::kNan}, {1.0, testing::kNan, testing::kNan}});
  runs.curves["nis_rows"] =
      testing::matrix_of({{1.0, 2.0, testing::kNan}, {1.0, testing::kNan, testing::kNan}});
  MetricsOptions options;
  options.band_probability = 0.9;
  const EstimatorMetrics metrics = compute_metrics(runs, options);
  const MetricCurve& nis = curve(metrics, "nis");
  // Two degrees of freedom are exponential; at step 1 they are those of two runs.
  CHECK(nis.low[1] == Approx(-2.0 * std::log(0.95)).epsilon(1e-12));
  CHECK(nis.high[1] == Approx(-2.0 * std::log(0.05)).epsilon(1e-12));
  CHECK(nis.low[0] == Approx(-std::log(0.95)).epsilon(1e-12));
  CHECK(nis.high[0] == Approx(-std::log(0.05)).epsilon(1e-12));
  CHECK(std::isnan(nis.low[2]));
  CHECK(std::isnan(nis.value[2]));
  CHECK(metric(metrics, "nis_in_band").count == 2);
  CHECK(metric(metrics, "nis_in_band").value == 1.0);
}

}  // namespace holdfast
