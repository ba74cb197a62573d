#include "tests/unit/tools/metrics/metric_cases.h"

namespace holdfast {
namespace {

using testing::curve;
using testing::kNan;
using testing::matrix_of;
using testing::metric;

const StateGroup kGroup = {"position", {0}, "m", 0.0};

EstimatorRuns runs_with(RunMatrix squares, const std::string& name = "ours") {
  EstimatorRuns runs;
  runs.estimator = name;
  runs.curves["squared_error.position"] = std::move(squares);
  return runs;
}

EstimatorMetrics metrics_of(RunMatrix squares, double lost_above = 0.0) {
  StateGroup group = kGroup;
  group.lost_above = lost_above;
  return compute_metrics(runs_with(std::move(squares)), testing::options_with({group}));
}

std::vector<PairedDifference> differences_of(const EstimatorRuns& runs,
                                             const EstimatorRuns& reference,
                                             const MetricsOptions& options) {
  return paired_differences(compute_metrics(runs, options), compute_metrics(reference, options),
                            options);
}

// Squared errors of one state, of a scale that grows with the step; correlated between the steps of
// a run as a filter's are.
RunMatrix gaussian_squares(std::size_t num_runs, double gain = 1.0, double own = 0.0,
                           std::string_view own_stream = "test/metrics") {
  return matrix_of(num_runs, 20, [&](std::size_t r, std::size_t k) {
    const double scale = 1.0 + 0.1 * static_cast<double>(k);
    const double error = testing::normal(r, 0, 0) + testing::normal(r, k, 1);
    const double extra = own == 0.0 ? 0.0 : own * testing::normal(r, k, 2, own_stream);
    return std::pow(scale * (gain * error + extra), 2);
  });
}

}  // namespace

TEST_CASE("the three RMSE are three numbers, each by its formula") {
  // Errors: run 0: 1 1, run 1: 1 7.
  const EstimatorMetrics metrics = metrics_of(matrix_of({{1.0, 1.0}, {1.0, 49.0}}));
  const Metric& over_time = metric(metrics, "rmse_over_time", "position");
  CHECK(over_time.value == Approx((1.0 + 5.0) / 2.0).epsilon(1e-15));
  CHECK(over_time.standard_error == Approx(std::sqrt(8.0 / 2.0)).epsilon(1e-15));
  CHECK(over_time.count == 2);
  CHECK(over_time.unit == "m");
  CHECK(metric(metrics, "rmse_over_time_median", "position").value == Approx(3.0));
  const MetricCurve& over_runs = curve(metrics, "rmse_over_runs");
  CHECK(over_runs.group == "position");
  CHECK(over_runs.value == std::vector<double>{1.0, 5.0});
  // sd of the squared errors 1 and 49 is 48 / sqrt 2; over 2 rmse sqrt N.
  CHECK(over_runs.standard_error[0] == 0.0);
  CHECK(over_runs.standard_error[1] ==
        Approx(48.0 / std::sqrt(2.0) / (2.0 * 5.0 * std::sqrt(2.0))).epsilon(1e-14));
  CHECK(metric(metrics, "rmse_step_mean", "position").value == 3.0);
  CHECK(metric(metrics_of(matrix_of({{1.0, 4.0, 81.0}})), "rmse_step_mean", "position").value ==
        4.0);
  CHECK(metric(metrics_of(matrix_of({{1.0, 4.0, 81.0}})), "rmse_step_median", "position").value ==
        2.0);
}

TEST_CASE("a Gaussian error's RMSE over time is its closed form") {
  // E of the RMSE over n steps of N(0, s^2): s sqrt(2 / n) Gamma((n + 1) / 2) / Gamma(n / 2).
  const std::size_t num_runs = 2000;
  const int n = 8;
  const double s = 3.0;
  const EstimatorMetrics metrics =
      metrics_of(matrix_of(num_runs, n, [&](std::size_t r, std::size_t k) {
        return std::pow(s * testing::normal(r, k, 0), 2);
      }));
  const double expected =
      s * std::sqrt(2.0 / n) * std::tgamma((n + 1) / 2.0) / std::tgamma(n / 2.0);
  const double deviation = std::sqrt(s * s - expected * expected);
  const Metric& over_time = metric(metrics, "rmse_over_time", "position");
  const double error = deviation / std::sqrt(static_cast<double>(num_runs));
  CHECK(over_time.value == Approx(expected).margin(4.0 * error));
  // A deviation told by N numbers close to Gaussian: relative error 1 / sqrt(2 N) = 1.6 %.
  CHECK(over_time.standard_error == Approx(error).epsilon(4.0 * 0.016));
  // Negative control: the RMSE over runs is s, which the same margin tells apart.
  CHECK(over_time.value != Approx(s).margin(4.0 * error));
  CHECK(metric(metrics, "rmse_step_mean", "position").value == Approx(s).margin(4.0 * error));
}

TEST_CASE("the bootstrap error of rmse_step_mean is that of the delta method") {
  const std::size_t num_runs = 400;
  const RunMatrix squares = gaussian_squares(num_runs);
  const EstimatorMetrics metrics = metrics_of(squares);
  const std::vector<double>& rmse = curve(metrics, "rmse_over_runs").value;
  std::vector<double> influence(num_runs, 0.0);
  double sum = 0.0, squared = 0.0;
  for (std::size_t r = 0; r < num_runs; ++r) {
    for (std::size_t k = 0; k < 20; ++k) influence[r] += squares.run(r)[k] / (2.0 * rmse[k]) / 20.0;
    sum += influence[r];
  }
  for (const double v : influence) squared += std::pow(v - sum / num_runs, 2);
  const double expected = std::sqrt(squared / num_runs / num_runs);
  // 400 resamples tell a deviation to 1 / sqrt(800) = 3.5 %; four times that, and 1 % for what is
  // not linear in 400 runs.
  CHECK(metric(metrics, "rmse_step_mean", "position").standard_error ==
        Approx(expected).epsilon(0.15));
  // Negative control: as if the steps of a run were independent.
  double independent = 0.0;
  for (const double error : curve(metrics, "rmse_over_runs").standard_error)
    independent += error * error;
  CHECK(metric(metrics, "rmse_step_mean", "position").standard_error !=
        Approx(std::sqrt(independent) / 20.0).epsilon(0.15));
}

TEST_CASE("the bootstrap error of rmse_step_mean, resample by resample") {
  const std::size_t num_runs = 30;
  const RunMatrix squares = gaussian_squares(num_runs);
  const RandomStream draws(1, 0, "campaign/bootstrap");
  double sum = 0.0, sum_squared = 0.0;
  for (std::uint32_t b = 0; b < 400; ++b) {
    std::vector<double> total(20, 0.0);
    for (std::size_t i = 0; i < num_runs; ++i) {
      const auto run = static_cast<std::size_t>(draws.uniform(b, i) * num_runs);
      for (std::size_t k = 0; k < 20; ++k) total[k] += squares.run(run)[k];
    }
    double mean = 0.0;
    for (const double value : total) mean += std::sqrt(value / num_runs) / 20.0;
    sum += mean;
    sum_squared += mean * mean;
  }
  // sum_squared / 400 - mean^2 loses digits: (mean / deviation)^2 1e-16, below 1e-12 here.
  CHECK(metric(metrics_of(squares), "rmse_step_mean", "position").standard_error ==
        Approx(std::sqrt(sum_squared / 400.0 - sum * sum / 160'000.0)).epsilon(1e-9));
}

TEST_CASE("a lost track is one whose last tenth is above the bound") {
  // 90 steps: the last nine count. Run 1 is off before them only, run 2 within them.
  RunMatrix squares = matrix_of(4, 90, [](std::size_t, std::size_t) { return 1.0; });
  squares.run(1)[80] = 1e6;
  squares.run(2)[81] = 1e6;
  const Metric lost = metric(metrics_of(squares, 2.0), "lost_share", "position");
  CHECK(lost.value == 0.25);
  CHECK(lost.count == 4);
  CHECK(lost.standard_error == Approx(std::sqrt(0.25 * 0.75 / 3.0)).epsilon(1e-15));
  // An RMSE at the bound is not above it.
  CHECK(metric(metrics_of(squares, 1.0), "lost_share", "position").value == 0.25);
  CHECK(find_metric(metrics_of(squares, 0.0), "lost_share", "position") == nullptr);
  // It is the error that counts, not its square.
  CHECK(metric(metrics_of(matrix_of({{9.0}}), 2.9), "lost_share", "position").value == 1.0);
  CHECK(metric(metrics_of(matrix_of({{9.0}}), 3.1), "lost_share", "position").value == 0.0);
  // Fewer than ten steps: the last one.
  CHECK(metric(metrics_of(matrix_of({{9.0, 9.0, 1.0}, {1.0, 1.0, 9.0}}), 2.0), "lost_share",
               "position")
            .value == 0.5);
}

TEST_CASE("what is missing is left out and told") {
  const EstimatorMetrics metrics = metrics_of(
      matrix_of({{4.0, kNan, 4.0, kNan}, {kNan, kNan, kNan, kNan}, {16.0, 16.0, 16.0, kNan}}), 1.0);
  const Metric& over_time = metric(metrics, "rmse_over_time", "position");
  CHECK(over_time.count == 2);
  CHECK(over_time.value == 3.0);
  CHECK(metric(metrics, "rmse_step_mean", "position").count == 2);
  const std::vector<double>& over_runs = curve(metrics, "rmse_over_runs").value;
  CHECK(over_runs[0] == Approx(std::sqrt(10.0)).epsilon(1e-15));
  CHECK(over_runs[1] == 4.0);
  CHECK(std::isnan(over_runs[3]));
  CHECK(metric(metrics, "rmse_step_mean", "position").value ==
        Approx((2.0 * std::sqrt(10.0) + 4.0) / 3.0).epsilon(1e-15));
  CHECK(metric(metrics, "missing_share", "position").value == Approx((0.5 + 1.0 + 0.25) / 3.0));
  CHECK(find_metric(metrics, "lost_share", "position") == nullptr);  // none has a last step
  CHECK(find_metric(metrics_of(gaussian_squares(3)), "missing_share", "position") == nullptr);
}

TEST_CASE("one run gives values without standard errors, and none gives nothing") {
  const EstimatorMetrics one = metrics_of(gaussian_squares(1), 1.0);
  CHECK(one.metrics.size() == 5);
  for (const Metric& found : one.metrics) {
    CHECK(std::isfinite(found.value));
    CHECK(std::isnan(found.standard_error));
  }
  for (const double error : curve(one, "rmse_over_runs").standard_error) CHECK(std::isnan(error));
  CHECK(metrics_of(RunMatrix()).metrics.empty());
  const EstimatorMetrics nothing = compute_metrics({}, testing::options_with({kGroup}));
  CHECK(nothing.metrics.empty());
  CHECK(nothing.curves.empty());
  CHECK(nothing.rocs.empty());
}

TEST_CASE("equal input gives equal bits, and the seed moves the errors only") {
  const EstimatorRuns runs = runs_with(gaussian_squares(50));
  MetricsOptions options = testing::options_with({kGroup});
  const EstimatorMetrics a = compute_metrics(runs, options), b = compute_metrics(runs, options);
  options.seed = 2;
  const EstimatorMetrics other = compute_metrics(runs, options);
  for (std::size_t i = 0; i < a.metrics.size(); ++i) {
    CHECK(a.metrics[i].value == b.metrics[i].value);
    CHECK(a.metrics[i].standard_error == b.metrics[i].standard_error);
    CHECK(a.metrics[i].value == other.metrics[i].value);
  }
  CHECK(metric(a, "rmse_step_mean", "position").standard_error !=
        metric(other, "rmse_step_mean", "position").standard_error);
}

TEST_CASE("curves of different runs or steps are refused") {
  EstimatorRuns runs = runs_with(gaussian_squares(5));
  runs.curves["nees"] = RunMatrix(5, 19, 1.0);
  CHECK_THROWS_AS(compute_metrics(runs, {}), std::invalid_argument);
  CHECK_THROWS_AS(differences_of(runs_with(gaussian_squares(5)), runs_with(gaussian_squares(6)),
                                 testing::options_with({kGroup})),
                  std::invalid_argument);
}

TEST_CASE("two equal estimators differ by exactly nothing") {
  const EstimatorRuns runs = runs_with(gaussian_squares(50));
  const auto differences = differences_of(runs, runs, testing::options_with({kGroup}));
  REQUIRE(differences.size() == 1);
  CHECK(differences[0].value == 0.0);
  CHECK(differences[0].standard_error == 0.0);
}

TEST_CASE("common random numbers make a difference sharper") {
  const MetricsOptions options = testing::options_with({kGroup});
  const EstimatorRuns reference = runs_with(gaussian_squares(300), "reference");
  const EstimatorRuns better = runs_with(gaussian_squares(300, 0.95, 0.1), "better");
  const PairedDifference difference = differences_of(better, reference, options).at(0);
  CHECK(difference.estimator == "better");
  CHECK(difference.reference == "reference");
  CHECK(difference.name == "rmse_step_mean");
  CHECK(difference.unit == "m");
  const Metric ours = metric(compute_metrics(better, options), "rmse_step_mean", "position");
  const Metric theirs = metric(compute_metrics(reference, options), "rmse_step_mean", "position");
  CHECK(difference.value == ours.value - theirs.value);
  CHECK(difference.value < -4.0 * difference.standard_error);
  // Their errors differ by a tenth of noise: the difference's scatter is a small part of that of
  // either. The negative control is the other case: independent errors gain nothing.
  const double apart = std::hypot(ours.standard_error, theirs.standard_error);
  CHECK(difference.standard_error < 0.3 * apart);
  const EstimatorRuns independent =
      runs_with(gaussian_squares(300, 0.0, std::sqrt(2.0), "test/other"), "independent");
  const double alone = differences_of(independent, reference, options).at(0).standard_error;
  const double other_error =
      metric(compute_metrics(independent, options), "rmse_step_mean", "position").standard_error;
  // 3.5 % from 400 resamples, and about 1 / sqrt(300) = 6 % of chance correlation; two of each.
  CHECK(alone == Approx(std::hypot(other_error, theirs.standard_error)).epsilon(0.2));
}

TEST_CASE("a group that one of two estimators does not hold has no difference") {
  EstimatorRuns outsider;
  outsider.estimator = "outsider";
  CHECK(differences_of(runs_with(gaussian_squares(5)), outsider, testing::options_with({kGroup}))
            .empty());
}

}  // namespace holdfast
