#include "tools/metrics/run_scores.h"

#include "tests/unit/tools/metrics/metric_cases.h"

namespace holdfast {
namespace {

const std::vector<StateGroup> kGroups = {{"first", {0, 1}, "m", 0.0}, {"second", {2, 3}, "m", 0.0}};
const std::vector<double> kTruth = {1.0, 2.0, 3.0, 4.0};

Estimate estimate_at(std::int64_t step, std::vector<double> mean) {
  Estimate estimate;
  estimate.step = step;
  estimate.mean = Eigen::Map<Eigen::VectorXd>(mean.data(), static_cast<Eigen::Index>(mean.size()));
  estimate.covariance = Eigen::MatrixXd::Identity(estimate.mean.size(), estimate.mean.size());
  return estimate;
}

TrueStep truth_of(const std::vector<double>& state, int mode = 0) {
  return {state, mode, false, {}};
}

RunScores score(const Estimate& estimate, const std::vector<double>& truth = kTruth) {
  RunScorer scorer(kGroups, 1);
  scorer.take(estimate, truth_of(truth));
  return scorer.finish();
}

std::vector<std::string> names_of(const RunScores& scores) {
  std::vector<std::string> names;
  for (const auto& [name, curve] : scores.curves) names.push_back(name);
  return names;
}

}  // namespace

TEST_CASE("a run's errors are squared and summed by group, at their steps") {
  RunScorer scorer(kGroups, 3);
  scorer.take(estimate_at(2, {2.0, 4.0, 3.0, 1.0}), truth_of(kTruth));
  scorer.take(estimate_at(3, {1.0, 2.0, 3.0, 4.5}), truth_of(kTruth));
  RunScores scores = scorer.finish();
  CHECK(names_of(scores) == std::vector<std::string>{"nees", "nees_rows", "squared_error.first",
                                                     "squared_error.second"});
  const std::vector<double>& first = scores.curves["squared_error.first"];
  REQUIRE(first.size() == 3);
  CHECK(std::isnan(first[0]));
  CHECK(first[1] == 5.0);
  CHECK(first[2] == 0.0);
  CHECK(scores.curves["squared_error.second"][1] == 9.0);
  CHECK(scores.curves["squared_error.second"][2] == 0.25);
  CHECK(scores.curves["nees"][1] == 14.0);
  CHECK(scores.curves["nees_rows"][1] == 4.0);
}

TEST_CASE("steps outside the run are ignored, and the first estimate of a step counts") {
  RunScorer scorer(kGroups, 2);
  for (const std::int64_t step : {0, -1, 3, 1'000'000'000})
    scorer.take(estimate_at(step, kTruth), truth_of(kTruth));
  CHECK(scorer.finish().curves.empty());
  RunScorer repeated(kGroups, 2);
  repeated.take(estimate_at(2, {2.0, 2.0, 3.0, 4.0}), truth_of(kTruth));
  repeated.take(estimate_at(1, kTruth), truth_of(kTruth));
  repeated.take(estimate_at(2, kTruth), truth_of(kTruth));
  CHECK(repeated.finish().curves["squared_error.first"] == std::vector<double>{0.0, 1.0});
}

TEST_CASE("an outsider with fewer states is scored on the groups that it holds") {
  CHECK(names_of(score(estimate_at(1, {1.0, 2.0}))) ==
        std::vector<std::string>{"squared_error.first"});
  CHECK(names_of(score(estimate_at(1, {1.0}))).empty());
  // The other way round: a truth of which the estimator holds more.
  CHECK(names_of(score(estimate_at(1, kTruth), {1.0, 2.0})) ==
        std::vector<std::string>{"squared_error.first"});
}

TEST_CASE("what is not finite or not positive definite gives no value") {
  CHECK(names_of(score(estimate_at(1, {1.0, 2.0, testing::kNan, 4.0}))).empty());
  const std::vector<std::string> errors_only = {"squared_error.first", "squared_error.second"};
  Estimate estimate = estimate_at(1, kTruth);
  estimate.covariance(2, 2) = 0.0;
  CHECK(names_of(score(estimate)) == errors_only);
  estimate.covariance(2, 2) = testing::kNan;
  CHECK(names_of(score(estimate)) == errors_only);
  estimate.covariance = Eigen::MatrixXd::Identity(3, 3);
  CHECK(names_of(score(estimate)) == errors_only);
  estimate.covariance.resize(0, 0);
  CHECK(names_of(score(estimate)) == errors_only);
  CHECK(names_of(score(estimate_at(1, kTruth), {})).empty());
  // Negative control: it was the covariance.
  CHECK(names_of(score(estimate_at(1, kTruth))).size() == 4);
}

TEST_CASE("NEES is the closed form of a correlated covariance") {
  RunScorer scorer({}, 1);
  Estimate estimate = estimate_at(1, {1.0, 0.0});
  estimate.covariance << 2.0, 1.0, 1.0, 2.0;  // inverse: [2 -1; -1 2] / 3
  scorer.take(estimate, truth_of({0.0, 0.0}));
  CHECK(scorer.finish().curves["nees"][0] == Approx(2.0 / 3.0).epsilon(1e-14));
}

TEST_CASE("NIS goes with the number of rows that arrived") {
  RunScorer scorer({}, 4);
  for (const auto& [step, rows] : {std::pair{1, 2}, std::pair{2, 20}, std::pair{3, 0}}) {
    Estimate estimate;
    estimate.step = step;
    estimate.innovation = Eigen::VectorXd::Constant(rows, 2.0);
    estimate.innovation_covariance = 0.5 * Eigen::MatrixXd::Identity(rows, rows);
    scorer.take(estimate, {});
  }
  Estimate wrong;
  wrong.step = 4;
  wrong.innovation = Eigen::VectorXd::Ones(2);
  wrong.innovation_covariance = -Eigen::MatrixXd::Identity(2, 2);
  scorer.take(wrong, {});
  RunScores scores = scorer.finish();
  const std::vector<double>&nis = scores.curves["nis"], &rows = scores.curves["nis_rows"];
  CHECK(nis[0] == Approx(16.0).epsilon(1e-14));
  CHECK(nis[1] == Approx(160.0).epsilon(1e-14));
  CHECK(rows[0] == 2.0);
  CHECK(rows[1] == 20.0);
  for (const std::size_t k : {2U, 3U}) {
    CHECK(std::isnan(nis[k]));
    CHECK(std::isnan(rows[k]));
  }
}

TEST_CASE("an attack probability counts when it is one") {
  RunScorer scorer({}, 4);
  Estimate estimate;
  for (const double probability : {-1.0, 0.25, testing::kNan, 1.5}) {
    ++estimate.step;
    estimate.attack_probability = probability;
    scorer.take(estimate, {});
  }
  const std::vector<double> kept = scorer.finish().curves["attack_probability"];
  CHECK(kept[1] == 0.25);
  for (const std::size_t k : {0U, 2U, 3U}) CHECK(std::isnan(kept[k]));
}

TEST_CASE("the most probable mode is compared with the true one") {
  RunScorer scorer({}, 4);
  Estimate estimate;
  estimate.step = 1;
  estimate.mode_probability = {0.2, 0.5, 0.3};
  scorer.take(estimate, truth_of({}, 1));
  estimate.step = 2;
  scorer.take(estimate, truth_of({}, 2));
  estimate.step = 3;
  estimate.mode_probability = {0.2, testing::kNan, 0.3};
  scorer.take(estimate, truth_of({}, 2));
  RunScores scores = scorer.finish();
  const std::vector<double>&correct = scores.curves["mode_correct"], &mode = scores.curves["mode"];
  CHECK(correct[0] == 1.0);
  CHECK(correct[1] == 0.0);
  CHECK(std::isnan(correct[2]));
  CHECK(mode[2] == 2.0);  // the truth is known all the same
  CHECK(std::isnan(mode[3]));
}

TEST_CASE("an attack signal's estimate is scored at the step to which it belongs") {
  const auto scored = [](std::int64_t lag, std::size_t num_rows) {
    RunScorer scorer({}, 4);
    for (std::int64_t k = 1; k <= 4; ++k) {
      const std::vector<double> signal = {static_cast<double>(k), 0.0};
      Estimate estimate;
      estimate.step = k;
      estimate.input_step = k - lag;
      estimate.input_mean = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(num_rows));
      estimate.input_mean[0] = static_cast<double>(k - 1);
      scorer.take(estimate, {{}, 0, true, signal});
    }
    return scorer.finish().curves["attack_signal_squared_error"];
  };
  const std::vector<double> late = scored(1, 2);
  REQUIRE(late.size() == 4);
  for (const std::size_t k : {0U, 1U, 2U}) CHECK(late[k] == 0.0);
  CHECK(std::isnan(late[3]));  // its estimate would come in step 5
  // Negative control: taken for the estimate of its own step, it is off by one.
  CHECK(scored(0, 2) == std::vector<double>(4, 1.0));
  CHECK(scored(-1, 2).empty());  // a truth that has not come yet
  CHECK(scored(1, 1).empty());   // rows that are not those of the truth
}

TEST_CASE("outcomes other than ok are counted by name") {
  RunScorer scorer({}, 10);
  Estimate estimate;
  for (int i = 0; i < 7; ++i) {
    ++estimate.step;
    estimate.outcome = static_cast<StepOutcome>(i % 5);
    scorer.take(estimate, {});
  }
  CHECK(scorer.finish().outcomes == std::map<std::string, std::int64_t>{{"no_packets", 2},
                                                                        {"refused_input", 1},
                                                                        {"factorisation_failed", 1},
                                                                        {"degenerate_weights", 1}});
  CHECK(outcome_name(StepOutcome::kOk) == "ok");
}

TEST_CASE("a score histogram adds up to the same whatever the order") {
  std::vector<ScoreHistogram> parts(3);
  for (std::size_t i = 0; i < 300; ++i)
    parts[i % 3].add(testing::uniform(0, 1, i), testing::uniform(0, 2, i) < 0.5);
  ScoreHistogram forward, backward;
  for (std::size_t i = 0; i < 3; ++i) forward.add(parts[i]);
  for (std::size_t i = 3; i-- > 0;) backward.add(parts[i]);
  CHECK(forward.positives == backward.positives);
  CHECK(forward.negatives == backward.negatives);
  CHECK(forward.positives != parts[0].positives);
}

TEST_CASE("a score histogram takes 0 and 1, and nothing outside") {
  ScoreHistogram histogram;
  for (const double score : {-1e-9, 1.0 + 1e-9, testing::kNan}) histogram.add(score, true);
  CHECK(histogram.is_empty());
  histogram.add(1.0, true);
  histogram.add(0.0, false);
  CHECK(histogram.positives.back() == 1);
  CHECK(histogram.negatives.front() == 1);
  CHECK_FALSE(histogram.is_empty());
  RunScorer scorer({}, 1);
  scorer.take_packet(0.0, true);  // surely not authentic
  CHECK(scorer.finish().packets.positives.back() == 1);
}

}  // namespace holdfast
