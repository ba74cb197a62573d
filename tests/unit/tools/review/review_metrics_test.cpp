#include "tools/review_metrics.h"

#include <algorithm>
#include <cmath>
#include <holdfast/attack_signal_t.hpp>
#include <nlohmann/json.hpp>

#include "tests/support/catch.h"
#include "tests/unit/tools/review/review_logs.h"
#include "tools/review_json.h"
#include "tools/review_report.h"

namespace holdfast {
namespace {

using namespace review_test;

void write_signal(LogWriter& log, std::int64_t step, const std::vector<double>& value) {
  attack_signal_t message{};
  message.step = step;
  message.name = "bias";
  message.value = value;
  message.num_values = static_cast<std::int32_t>(value.size());
  log.write_message("ATTACK_SIGNAL", 0, message);
}

void write_frame_attack(LogWriter& log, std::int64_t step) {
  attack_frame_t message = make_attack(attack_frame_t::DROPPED, -1, "drop");
  message.step = step;
  log.write_message("ATTACK_FRAME", 0, message);
}

double metric(const EstimatorMetrics& metrics, const std::string& name,
              const std::string& group = "") {
  for (const Metric& m : metrics.metrics) {
    if (m.name == name && m.group == group) return m.value;
  }
  return std::nan("");
}

// Four steps; the signal acts in step 2, a rule in step 3. The detector calls 1 (wrongly) and 3.
void write_detector_run(LogWriter& log) {
  write_meta(log);
  for (std::int64_t k = 1; k <= 4; ++k) {
    write_truth(log, k, {0, 0, 0, 0});
    write_signal(log, k, {0.0, k == 2 ? -0.5 : 0.0});
    if (k == 3) write_frame_attack(log, k);
    estimate_t estimate = make_estimate(k, {3, 0, 4, 0});
    estimate.attack_probability = k == 1 ? 0.6 : k == 3 ? 0.9 : k == 2 ? 0.2 : 0.1;
    estimate.mode_probability = {0.3, 0.7};
    estimate.num_modes = 2;
    log.write_message("EST_SECURE", 0, estimate);
  }
}

TEST_CASE("attacked steps come from signals and rules, and detections are counted against them") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("log"));
    write_detector_run(log);
  }
  const RunReview review = review_log(folder.file("log"));
  CHECK(review.is_attacked == std::vector<double>{0, 1, 1, 0});
  const EstimatorMetrics& metrics = review.estimators[0].metrics;
  CHECK(metric(metrics, "false_alarm_rate") == 0.5);
  CHECK(metric(metrics, "missed_detection_rate") == 0.5);
  CHECK(metric(metrics, "detection_delay") == 1.0);  // one attack, steps 2 and 3, called at 3
  // Attacked 0.2, 0.9 against 0.6, 0.1: three of the four pairs are in order.
  CHECK(metric(metrics, "auc_steps") == 0.75);
  CHECK(metric(metrics, "mode_accuracy") == 0.0);  // the true mode is 0
  CHECK(metric(metrics, "rmse_over_time", "position") == 5.0);
  CHECK(review.estimators[0].errors[0].rmse.value() == 5.0);
  const auto json = nlohmann::json::parse(review_json(review));
  CHECK(json["attacked_steps"] == 2);
  const auto& all = json["estimators"][0]["metrics"];
  const auto found =
      std::ranges::find_if(all, [](const auto& m) { return m["name"] == "false_alarm_rate"; });
  REQUIRE(found != all.end());
  CHECK((*found)["value"] == 0.5);
  CHECK(json["estimators"][0]["rocs"]["steps"]["area"] == 0.75);
}

TEST_CASE("a log that does not tell of attacks gives no detection rates") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("log"));
    write_meta(log);
    write_truth(log, 1, {0, 0, 0, 0});
    estimate_t estimate = make_estimate(1, {0, 0, 0, 0});
    estimate.attack_probability = 0.9;
    log.write_message("EST_SECURE", 0, estimate);
  }
  const RunReview review = review_log(folder.file("log"));
  CHECK(review.is_attacked.empty());
  CHECK(std::isnan(metric(review.estimators[0].metrics, "false_alarm_rate")));
  CHECK(nlohmann::json::parse(review_json(review))["attacked_steps"].is_null());
}

TEST_CASE("matrices and outcomes that fit nothing are left out of the scores") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("log"));
    write_meta(log);
    write_truth(log, 1, {0, 0, 0, 0});
    estimate_t odd = make_estimate(1, {3, 0, 4, 0}, {1, 2, 3});
    odd.outcome = 77;
    odd.innovation = {1.0};
    odd.num_innovation = 1;
    odd.innovation_covariance = {1, 2};
    odd.num_innovation_covariance = 2;
    odd.input_mean = {1.0};
    odd.num_inputs = 1;
    odd.input_step = -5;
    log.write_message("EST_SECURE", 0, odd);
  }
  const RunReview review = review_log(folder.file("log"));
  const EstimatorReview& secure = review.estimators[0];
  CHECK(secure.errors[0].rmse.value() == 5.0);
  CHECK_FALSE(secure.nees_mean.has_value());
  CHECK(std::isnan(metric(secure.metrics, "nis_mean")));
  CHECK(secure.outcomes.at("outcome_77") == 1);
}

// A run whose estimators are off by these.
void write_offset_run(const std::string& file, std::int64_t run, double secure, double neglect) {
  LogWriter log(file);
  RunMeta meta;
  meta.name = "hand_made";
  meta.scenario = kScenario + "seed: " + std::to_string(run) + "\n";
  meta.seed = run;
  run_meta_t message = to_message(meta);
  log.write_message("RUN_META", 0, message);
  for (std::int64_t k = 1; k <= 4; ++k) {
    write_truth(log, k, {0, 0, 0, 0});
    write_estimate(log, "EST_SECURE", k, {secure, 0, 0, 0});
    write_estimate(log, "EST_NEGLECT", k, {neglect, 0, 0, 0});
  }
}

TEST_CASE("logs of one scenario are averaged whatever their seeds, others are not") {
  const TemporaryFolder folder;
  write_offset_run(folder.file("a"), 1, 3.0, 6.0);
  write_offset_run(folder.file("b"), 2, 4.0, 8.0);
  {
    LogWriter other(folder.file("other"));
    std::string scenario = kScenario;
    scenario.replace(scenario.find("hand_made"), 9, "different");
    write_meta(other, scenario);
    write_truth(other, 1, {0, 0, 0, 0});
    write_estimate(other, "EST_SECURE", 1, {100, 0, 0, 0});
  }
  std::vector<RunReview> reviews;
  for (const char* name : {"a", "b", "other"}) reviews.push_back(review_log(folder.file(name)));
  const std::vector<CombinedReview> combined = combine_reviews(reviews);
  REQUIRE(combined.size() == 1);
  CHECK(combined[0].files.size() == 2);
  CHECK(combined[0].notes.empty());
  REQUIRE(combined[0].estimators.size() == 2);  // the campaign-only one has no estimates
  // RMSE over the runs at each step: sqrt((9 + 16) / 2). Few roundings of one.
  const double expected = std::sqrt(12.5);
  CHECK(metric(combined[0].estimators[0], "rmse_step_mean", "position") ==
        Approx(expected).epsilon(1e-14));
  CHECK(metric(combined[0].estimators[0], "rmse_over_time", "position") == 3.5);
  REQUIRE_FALSE(combined[0].differences.empty());
  CHECK(combined[0].differences[0].estimator == "neglect");
  CHECK(combined[0].differences[0].reference == "secure");
  CHECK(combined[0].differences[0].value == Approx(expected).epsilon(1e-14));  // twice the errors
  const std::string table = combined_table(combined[0]);
  CHECK(table.find("2 runs") != std::string::npos);
  CHECK(table.find("±") != std::string::npos);
  const auto json = nlohmann::json::parse(reviews_json(reviews, combined));
  CHECK(json["logs"].size() == 3);
  CHECK(json["combined"][0]["differences"][0]["reference"] == "secure");
  CHECK_FALSE(json["combined"][0]["estimators"][0]["metrics"][0]["standard_error"].is_null());
}

TEST_CASE("the same run twice, and an estimator that is missing, are told") {
  const TemporaryFolder folder;
  write_offset_run(folder.file("a"), 1, 3.0, 6.0);
  write_offset_run(folder.file("b"), 1, 3.0, 6.0);
  {
    LogWriter log(folder.file("c"));
    write_meta(log, kScenario + "seed: 9\n");
    write_truth(log, 1, {0, 0, 0, 0});
    write_estimate(log, "EST_SECURE", 1, {1, 0, 0, 0});
  }
  std::vector<RunReview> reviews;
  for (const char* name : {"a", "b", "c"}) reviews.push_back(review_log(folder.file(name)));
  const std::vector<CombinedReview> combined = combine_reviews(reviews);
  REQUIRE(combined.size() == 1);
  const auto has_note = [&](const std::string& part) {
    return std::ranges::any_of(combined[0].notes, [&](const std::string& note) {
      return note.find(part) != std::string::npos;
    });
  };
  CHECK(has_note("seed 1, run 0 stands in more than one log"));
  CHECK(has_note("neglect is missing in 1 of 3 logs"));
}

}  // namespace
}  // namespace holdfast
