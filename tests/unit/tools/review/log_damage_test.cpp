#include <algorithm>
#include <nlohmann/json.hpp>

#include "common/log_file.h"
#include "tests/support/catch.h"
#include "tests/unit/tools/review/review_logs.h"
#include "tools/log_meta.h"
#include "tools/log_review.h"
#include "tools/review_json.h"
#include "tools/review_report.h"

namespace holdfast {
namespace {

using namespace review_test;

constexpr std::int64_t kSteps = 4;

void write_run(LogWriter& log, const std::string& scenario = kScenario) {
  write_meta(log, scenario);
  for (std::int64_t k = 1; k <= kSteps; ++k) {
    write_truth(log, k, {0, 0, 0, 0});
    write_estimate(log, "EST_SECURE", k, {3, 0, 4, 0});
    write_estimate(log, "EST_NEGLECT", k, {1, 0, 0, 0});
  }
}

// Place of the nth event on a channel.
std::size_t event_start(const std::string& bytes, const std::string& channel, int nth) {
  std::size_t at = 0;
  for (int i = 0; i <= nth; ++i) at = bytes.find(channel, at + 1);
  return at - 28;
}

TEST_CASE("a damaged length swallows events, which are found again") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("log"));
    write_run(log);
  }
  const std::string bytes = read_file(folder.file("log"));
  const RunReview whole = review_log(folder.file("log"));
  const std::size_t start = event_start(bytes, "EST_SECURE", 1);
  for (const int bit : {1, 6}) {  // 2 bytes too long, and 256 more: over three events
    INFO(bit);
    std::string damaged = bytes;
    damaged[start + (bit == 1 ? 27 : 26)] ^= static_cast<char>(1 << (bit == 1 ? 1 : 0));
    write_file(folder.file("damaged"), damaged);
    const RunReview review = review_log(folder.file("damaged"));
    CHECK(review.damaged_bytes > 0);
    CHECK(review.truth_steps == kSteps);
    REQUIRE(review.estimators.size() == whole.estimators.size());
    CHECK(review.estimators[0].num_steps == kSteps - 1);
    CHECK(review.estimators[1].num_steps == kSteps);
    CHECK(review.estimators[0].errors[0].rmse.value() == 5.0);
  }
}

TEST_CASE("one flipped bit anywhere costs at most the event it stands in") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("log"));
    write_run(log);
  }
  const std::string bytes = read_file(folder.file("log"));
  const std::size_t body = event_start(bytes, "PLANT_TRUTH", 0);
  int num_found = 0;
  for (std::size_t at = body; at < bytes.size(); ++at) {
    std::string damaged = bytes;
    damaged[at] ^= static_cast<char>(1 << (at % 8));
    write_file(folder.file("damaged"), damaged);
    const RunReview review = review_log(folder.file("damaged"));
    std::int64_t num_kept = review.truth_steps;
    for (const EstimatorReview& estimator : review.estimators) {
      const auto& scores = estimator.scores.curves;
      if (const auto found = scores.find("squared_error.position"); found != scores.end())
        num_kept += std::ranges::count_if(found->second, [](double v) { return v == v; });
    }
    INFO("byte " << at);
    // A lost truth takes the errors of its step's estimates with it.
    CHECK(num_kept >= 3 * kSteps - 3);
    num_found += num_kept == 3 * kSteps ? 0 : 1;
  }
  CHECK(num_found > 100);  // the flips do damage
}

TEST_CASE("times that go back are counted and shown") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("log"));
    write_meta(log);
    const auto write = [&log](std::int64_t step, std::int64_t utime, std::int64_t log_utime) {
      truth_t message{};
      message.step = step;
      message.utime = utime;
      message.state = {0, 0, 0, 0};
      message.num_states = 4;
      log.write_message("PLANT_TRUTH", log_utime, message);
    };
    write(1, 100, 3'000'000);
    write(2, 200, 2'000'000);
    write(3, 150, 5'000'000);
    write(4, 150, 5'000'000);  // the same is not back
  }
  const RunReview review = review_log(folder.file("log"));
  CHECK(review.backward_log_times == 1);
  CHECK(review.backward_log_us == 1'000'000);
  CHECK(review.troubles.at("PLANT_TRUTH").backward_utime == 1);
  CHECK(review.truth_steps == 4);
  CHECK(has_warning(review, "the log's time goes back 1 times"));
  CHECK(has_warning(review, "PLANT_TRUTH: utime went back 1 times"));
  const auto json = nlohmann::json::parse(review_json(review));
  CHECK(json["log"]["backward_log_times"] == 1);
  CHECK(json["log"]["channels"]["PLANT_TRUTH"]["backward_utime"] == 1);
  CHECK(review_table(review).find("time goes back 1 times, by at most 1 s") != std::string::npos);
}

TEST_CASE("stamps a little out of order, as loggers leave them, are shown but no warning") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("log"));
    write_run(log);
    log.write("OTHER", 2000, {1});
    log.write("OTHER", 1000, {1});
  }
  const RunReview review = review_log(folder.file("log"));
  CHECK(review.backward_log_times == 1);
  CHECK_FALSE(has_warning(review, "time goes back"));
  CHECK(review_table(review).find("time goes back 1 times, by at most 0.001 s") !=
        std::string::npos);
}

TEST_CASE("a damaged RUN_META is told, and a whole one behind it counts") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("one"));
    write_run(log);
    LogWriter twice(folder.file("twice"));
    write_meta(twice);
    write_run(twice);
  }
  const auto damage = [&](const std::string& name) {
    std::string bytes = read_file(folder.file(name));
    bytes[bytes.find("steps: 4") + 5] = '[';  // no YAML any more
    write_file(folder.file(name), bytes);
  };
  damage("one");
  damage("twice");
  const RunReview one = review_log(folder.file("one"));
  CHECK(has_warning(one, "the scenario in RUN_META is damaged"));
  CHECK(one.truth_steps == kSteps);
  CHECK(one.estimators.size() == 2);  // as outsiders
  const RunReview twice = review_log(folder.file("twice"));
  CHECK_FALSE(has_warning(twice, "the scenario in RUN_META is damaged"));
  CHECK(twice.estimators[0].errors[0].rmse.value() == 5.0);
  CHECK_FALSE(read_logged_meta(folder.file("twice")).is_damaged);
}

TEST_CASE("invented channels and steps take no memory, and hide nobody") {
  const TemporaryFolder folder;
  std::string scenario = kScenario;
  scenario.replace(scenario.find("steps: 4"), 8, "steps: 4000000000000");
  {
    LogWriter log(folder.file("log"));
    write_meta(log, scenario);
    for (int i = 0; i < 3000; ++i) {
      write_estimate(log, "EST_FAKE" + std::to_string(i), 1, {0, 0, 0, 0});
      write_estimate(log, "EST_FAKE", 1'000'000'000 + i, {0, 0, 0, 0});
    }
    for (std::int64_t k = 1; k <= kSteps; ++k) {
      write_truth(log, k, {0, 0, 0, 0});
      write_estimate(log, "EST_SECURE", k, {3, 0, 4, 0});
    }
  }
  const RunReview review = review_log(folder.file("log"));
  CHECK(review.estimators[0].name == "secure");
  CHECK(review.estimators[0].errors[0].rmse.value() == 5.0);
  CHECK(review.estimators.size() < 100);
  CHECK(review.num_scored < 10'000);
  CHECK(has_warning(review, "channels beyond the first thousand"));
  CHECK(has_warning(review, "have no place in the metrics"));
}

}  // namespace
}  // namespace holdfast
