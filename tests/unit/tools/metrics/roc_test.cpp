#include "tools/metrics/roc.h"

#include "tests/unit/tools/metrics/metric_cases.h"

namespace holdfast {
namespace {

// Scores of attacked steps tend to be higher, in some runs far more than in others. `levels` equal
// steps between 0 and 1: few make many ties.
std::vector<RunScore> drawn_scores(std::size_t num_runs, std::size_t per_run, double levels) {
  std::vector<RunScore> scores;
  for (std::size_t r = 0; r < num_runs; ++r) {
    for (std::size_t i = 0; i < per_run; ++i) {
      const bool is_positive = testing::uniform(r, 1, i) < 0.3;
      const double u =
          0.5 * testing::uniform(r, 2, i) + (is_positive ? 0.5 * testing::uniform(r, 0, 0) : 0.0);
      const double score = (std::floor(u * levels) + 0.5) / levels;
      scores.push_back({score, static_cast<std::uint32_t>(r), is_positive});
    }
  }
  return scores;
}

double area_by_pairs(const std::vector<RunScore>& scores, const std::vector<double>& weight) {
  double won = 0.0, pairs = 0.0;
  for (const RunScore& positive : scores) {
    if (!positive.is_positive) continue;
    for (const RunScore& negative : scores) {
      if (negative.is_positive) continue;
      const double w = weight[positive.run] * weight[negative.run];
      pairs += w;
      if (positive.score > negative.score) won += w;
      if (positive.score == negative.score) won += 0.5 * w;
    }
  }
  return won / pairs;
}

void check_shape(const RocCurve& curve) {
  REQUIRE(curve.false_alarm_rate.size() == curve.detection_rate.size());
  CHECK(curve.false_alarm_rate.size() <= 500);
  CHECK(curve.false_alarm_rate.front() == 0.0);
  CHECK(curve.detection_rate.front() == 0.0);
  CHECK(curve.false_alarm_rate.back() == 1.0);
  CHECK(curve.detection_rate.back() == 1.0);
  CHECK(std::is_sorted(curve.false_alarm_rate.begin(), curve.false_alarm_rate.end()));
  CHECK(std::is_sorted(curve.detection_rate.begin(), curve.detection_rate.end()));
}

double trapezoids(const RocCurve& curve) {
  double area = 0.0;
  for (std::size_t i = 1; i < curve.false_alarm_rate.size(); ++i) {
    area += (curve.false_alarm_rate[i] - curve.false_alarm_rate[i - 1]) *
            (curve.detection_rate[i] + curve.detection_rate[i - 1]) / 2.0;
  }
  return area;
}

ScoreHistogram histogram_of(const std::vector<RunScore>& scores, std::size_t run) {
  ScoreHistogram histogram;
  for (const RunScore& s : scores) {
    if (s.run == run) histogram.add(s.score, s.is_positive);
  }
  return histogram;
}

}  // namespace

TEST_CASE("the area of perfect, reversed and blind scores") {
  const auto area = [](double positive, double negative) {
    return roc_of_scores({{positive, 0, true}, {negative, 0, false}, {negative, 0, false}}, 1).area;
  };
  CHECK(area(0.9, 0.1).value == 1.0);
  CHECK(area(0.1, 0.9).value == 0.0);
  CHECK(area(0.5, 0.5).value == 0.5);
  CHECK(area(0.9, 0.1).count == 3);
  CHECK(std::isnan(area(0.9, 0.1).standard_error));  // one run
  // When all are ties, no run can move the area.
  CHECK(roc_of_scores({{0.5, 0, true}, {0.5, 1, false}, {0.5, 1, true}}, 2).area.standard_error ==
        0.0);
  CHECK(std::isnan(roc_of_scores({{0.9, 0, true}}, 1).area.value));
  CHECK(std::isnan(roc_of_scores({}, 0).area.value));
}

TEST_CASE("the area is the share of pairs won, ties one half") {
  for (const double levels : {1.0, 2.0, 7.0, 1e12}) {
    const std::vector<RunScore> scores = drawn_scores(10, 40, levels);
    const Roc roc = roc_of_scores(scores, 10);
    // Sums of whole and half numbers are exact; what is left is two divisions against one.
    CHECK(roc.area.value ==
          Approx(area_by_pairs(scores, std::vector<double>(10, 1.0))).epsilon(1e-14));
    check_shape(roc.curve);
    CHECK(trapezoids(roc.curve) == Approx(roc.area.value).epsilon(1e-12));  // not thinned
  }
}

TEST_CASE("a long curve is thinned, its area is not") {
  const std::vector<RunScore> scores = drawn_scores(50, 400, 1e12);
  const Roc roc = roc_of_scores(scores, 50);
  check_shape(roc.curve);
  CHECK(roc.curve.false_alarm_rate.size() > 400);
  CHECK(roc.curve.area ==
        Approx(area_by_pairs(scores, std::vector<double>(50, 1.0))).epsilon(1e-14));
  // A kept point is at most two of 498 cells of length 2 / 498 from the next, so that a curve
  // between cannot leave a triangle of area (4 / 498)^2 / 8 at each.
  CHECK(trapezoids(roc.curve) == Approx(roc.area.value).margin(500.0 * std::pow(4.0 / 498, 2) / 8));
}

TEST_CASE("the area's standard error is that of a bootstrap over runs") {
  const std::size_t num_runs = 60;
  const std::vector<RunScore> scores = drawn_scores(num_runs, 10, 20.0);
  const RunBootstrap bootstrap(1, num_runs, 400);
  std::vector<double> areas;
  for (std::size_t b = 0; b < 400; ++b) {
    const auto weights = bootstrap.weights(b);
    areas.push_back(area_by_pairs(scores, std::vector<double>(weights.begin(), weights.end())));
  }
  const double error = roc_of_scores(scores, num_runs).area.standard_error;
  // 400 resamples: 3.5 %, four times that; and 60 runs: N / (N - 1) and what is not linear, 3 %.
  CHECK(error == Approx(bootstrap_error(areas)).epsilon(0.17));
  // Negative control: every score in a run of its own, as if they were independent.
  std::vector<RunScore> apart = scores;
  for (std::size_t i = 0; i < apart.size(); ++i) apart[i].run = static_cast<std::uint32_t>(i);
  CHECK(roc_of_scores(apart, apart.size()).area.standard_error !=
        Approx(bootstrap_error(areas)).epsilon(0.17));
}

TEST_CASE("binned scores and scores in the middle of bins give the same curve, area and error") {
  const std::size_t num_runs = 20;
  const std::vector<RunScore> scores = drawn_scores(num_runs, 50, 1000.0);
  ScoreHistogram all;
  std::vector<ScoreHistogram> of_runs;
  for (std::size_t r = 0; r < num_runs; ++r) {
    of_runs.push_back(histogram_of(scores, r));
    all.add(of_runs.back());
  }
  const Roc exact = roc_of_scores(scores, num_runs), binned = roc_of_histogram(all, of_runs);
  CHECK(binned.area.value == exact.area.value);
  CHECK(binned.area.count == exact.area.count);
  CHECK(binned.area.standard_error == Approx(exact.area.standard_error).epsilon(1e-12));
  CHECK(binned.curve.false_alarm_rate == exact.curve.false_alarm_rate);
  CHECK(binned.curve.detection_rate == exact.curve.detection_rate);
  CHECK(std::isnan(roc_of_histogram(all, {}).area.standard_error));
}

TEST_CASE("steps and packets have their own curves") {
  const RunMatrix is_attacked = testing::matrix_of({{0.0, 1.0}, {1.0, 0.0}});
  EstimatorRuns runs;
  runs.curves["attack_probability"] = testing::matrix_of({{0.3, 0.4}, {0.6, 0.5}});
  runs.is_attacked = &is_attacked;
  runs.packets.add(0.2, true);
  runs.packets.add(0.7, false);
  const EstimatorMetrics metrics = compute_metrics(runs, {});
  REQUIRE(metrics.rocs.size() == 2);
  CHECK(metrics.rocs[0].name == "steps");
  CHECK(metrics.rocs[0].area == 0.75);
  CHECK(metrics.rocs[1].name == "packets");
  CHECK(metrics.rocs[1].area == 0.0);
  CHECK(testing::metric(metrics, "auc_steps").value == 0.75);
  CHECK(testing::metric(metrics, "auc_steps").count == 4);
  CHECK(testing::metric(metrics, "auc_packets").value == 0.0);
  CHECK(std::isnan(testing::metric(metrics, "auc_packets").standard_error));
}

}  // namespace holdfast
