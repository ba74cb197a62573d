#include "tools/log_review.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "tests/support/catch.h"
#include "tests/unit/tools/review/review_logs.h"
#include "tools/review_report.h"

namespace holdfast {
namespace {

using namespace review_test;

const std::vector<double> kTruth = {1.0, 0.0, 2.0, 0.0};
constexpr double kInfinity = std::numeric_limits<double>::infinity();

const EstimatorReview& estimator(const RunReview& review, const std::string& name) {
  for (const EstimatorReview& e : review.estimators) {
    if (e.name == name) return e;
  }
  FAIL("no estimator " << name);
  return review.estimators.front();
}

// A run of four steps in which both estimators are off by known amounts.
void write_clean_run(LogWriter& log) {
  write_meta(log);
  for (std::int64_t k = 1; k <= 4; ++k) {
    write_truth(log, k, kTruth);
    // Errors 3 and 4 in the plane: 5; covariance 25 I, so NEES (9 + 16 + 1) / 25.
    write_estimate(log, "EST_SECURE", k, {4.0, 1.0, 6.0, 0.0},
                   {25, 0, 0, 0, 0, 25, 0, 0, 0, 0, 25, 0, 0, 0, 0, 25});
    write_estimate(log, "EST_NEGLECT", k, {1.0 + static_cast<double>(k), 0.0, 2.0, 0.0});
    timing_t timing{};
    timing.step = k;
    timing.compute_time_ns = 1000 * k;
    timing.latency_ns = -1;
    log.write_message("TIMING_SECURE", 0, timing);
  }
  write_status(log, "plant", status_t::RUNNING, {{"frames_sent", 4}});
  write_status(log, "plant", status_t::FINISHED, {{"frames_sent", 68}, {"lcm_lost", 0}});
}

TEST_CASE("errors, NEES and times have their closed-form values") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("log"));
    write_clean_run(log);
  }
  const RunReview review = review_log(folder.file("log"));
  CHECK(review.name == "hand_made");
  CHECK(review.seed == 7);
  CHECK(review.num_steps == 4);
  const EstimatorReview& secure = estimator(review, "secure");
  CHECK(secure.num_steps == 4);
  CHECK(secure.missing_steps == 0);
  REQUIRE(secure.errors.size() == 2);
  CHECK(secure.errors[0].name == "position");
  // Sums and roots of small whole numbers are exact.
  CHECK(secure.errors[0].rmse.value() == 5.0);
  CHECK(secure.errors[1].rmse.value() == 1.0);
  // One Cholesky solve of a diagonal matrix: a few roundings.
  CHECK(secure.nees_mean.value() == Approx(26.0 / 25.0).epsilon(1e-14));
  CHECK(secure.compute_time.p50_us == 2.0);
  CHECK(secure.compute_time.p99_us == 4.0);
  CHECK(secure.compute_time.max_us == 4.0);
  CHECK(secure.latency.count == 0);
  const EstimatorReview& neglect = estimator(review, "neglect");
  CHECK(neglect.errors[0].rmse.value() == std::sqrt((1.0 + 4.0 + 9.0 + 16.0) / 4.0));
  CHECK_FALSE(neglect.nees_mean.has_value());
  CHECK(estimator(review, "uncorrupted").is_campaign_only);
  CHECK(review.frames_sent.value() == 68);  // the newest status, not the first
  CHECK(review.losses_in_all == 0);
  CHECK(review.warnings.empty());
}

TEST_CASE(
    "what only looking back can give is offline, and no missing step, until somebody looked") {
  const TemporaryFolder folder;
  std::string scenario = kScenario;
  const std::string plain = "{name: secure}";
  scenario.replace(scenario.find(plain), plain.size(), "{name: secure, smoother: {lag_steps: 0}}");
  for (const bool has_looked : {false, true}) {
    {
      LogWriter log(folder.file("log"));
      write_meta(log, scenario);
      write_truth(log, 1, kTruth);
      write_estimate(log, "EST_SECURE", 1, kTruth);
      if (has_looked) write_estimate(log, "SMOOTHED_SECURE", 1, kTruth);
    }
    const RunReview review = review_log(folder.file("log"));
    const EstimatorReview& smoothed = estimator(review, "secure_smoothed");
    CHECK(smoothed.is_offline == !has_looked);
    CHECK_FALSE(smoothed.is_campaign_only);
    CHECK(smoothed.missing_steps == (has_looked ? 3 : 0));
    CHECK((review_table(review).find("offline") != std::string::npos) == !has_looked);
  }
  // With a lag it is published live, so that it can be missed.
  scenario.replace(scenario.find("lag_steps: 0"), 12, "lag_steps: 3");
  {
    LogWriter log(folder.file("log"));
    write_meta(log, scenario);
    write_estimate(log, "EST_SECURE", 1, kTruth);
  }
  const RunReview review = review_log(folder.file("log"));
  CHECK_FALSE(estimator(review, "secure_smoothed").is_offline);
  CHECK(estimator(review, "secure_smoothed").missing_steps == 4);
}

TEST_CASE("latency counts from the newest reading, on either side of the attacker") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("log"));
    write_meta(log);
    for (std::int64_t k = 1; k <= 4; ++k) {
      write_truth(log, k, kTruth);
      // Two readings a step, read by the attacker at 1000 k - 5 and 1000 k us, by the driver 100 k
      // later; estimated 40 us after that.
      can_frames_t sent{}, received{};
      measurement_set_t set{};
      sent.step = received.step = set.step = k;
      for (std::int64_t i = 0; i < 2; ++i) {
        can_frame_t frame{};
        frame.index = 2 * (k - 1) + i;
        frame.identifier = static_cast<std::int32_t>(16 * k + i);
        frame.receive_utime = 1000 * k - 5 * (1 - i);
        sent.frames.push_back(frame);
        frame.receive_utime += 100 * k;
        received.frames.push_back(frame);
        packet_t packet{};
        packet.rx_index = frame.index;
        packet.receive_utime = frame.receive_utime;
        set.packets.push_back(packet);
      }
      sent.num_frames = received.num_frames = set.num_packets = 2;
      log.write_message("CAN_TX", 0, sent);
      log.write_message("CAN_RX", 0, received);
      log.write_message("MEASUREMENT", 0, set);
      write_estimate(log, "EST_SECURE", k, kTruth);
      timing_t timing{};
      timing.step = k;
      timing.latency_ns = 40'000;
      log.write_message("TIMING_SECURE", 0, timing);
    }
    write_status(log, "plant", status_t::FINISHED, {{"frames_sent", 8}, {"missed_deadlines", 1}});
  }
  const ReviewedLog log = read_reviewed_log(folder.file("log"));
  const EstimatorReview& secure = estimator(log.review, "secure");
  CHECK(secure.latency.count == 4);
  CHECK(secure.latency.max_us == 40.0);
  CHECK(secure.sensor_latency.count == 4);
  CHECK(secure.sensor_latency.p50_us == 240.0);
  CHECK(secure.sensor_latency.max_us == 440.0);
  CHECK_FALSE(secure.sensor_latency.beyond_period.has_value());  // no whole scenario, no pace
  const std::string text = review_table(log.review);
  CHECK(text.find("sensor bus to estimate") != std::string::npos);
  CHECK(text.find("plant missed: 1 of 4 (25 %)") != std::string::npos);
}

TEST_CASE("missing, repeated, failed and non-finite steps are told apart") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("log"));
    write_meta(log);
    for (std::int64_t k = 1; k <= 3; ++k) write_truth(log, k, kTruth);
    write_estimate(log, "EST_SECURE", 1, kTruth);
    write_estimate(log, "EST_SECURE", 1, {100.0, 0.0, 0.0, 0.0});  // second word on step 1
    write_estimate(log, "EST_SECURE", 2, {NAN, 0.0, 0.0, 0.0});
    estimate_t failed = make_estimate(4, kTruth);  // no truth in step 4
    failed.outcome = estimate_t::OUTCOME_DEGENERATE_WEIGHTS;
    log.write_message("EST_SECURE", 0, failed);
    write_estimate(log, "EST_SECURE", 0, kTruth);  // a prior is no step
    write_estimate(log, "EST_SECURE", 5, kTruth);  // the scenario has four
    write_estimate(log, "EST_OUTSIDER", 1,
                   {1.0, 0.0, 2.0});  // holds the position, not y's velocity
  }
  const RunReview review = review_log(folder.file("log"));
  const EstimatorReview& secure = estimator(review, "secure");
  CHECK(secure.num_steps == 1);
  CHECK(secure.missing_steps == 1);
  CHECK(secure.repeated_steps == 1);
  CHECK(secure.non_finite_steps == 1);
  CHECK(secure.errors[0].rmse.value() == 0.0);  // the first word counts
  CHECK(secure.outcomes.at("degenerate_weights") == 1);
  CHECK(review.troubles.at("EST_SECURE").odd_step == 1);
  CHECK(estimator(review, "neglect").missing_steps == 4);
  CHECK_FALSE(estimator(review, "neglect").errors[0].rmse.has_value());
  const EstimatorReview& outsider = estimator(review, "OUTSIDER");
  CHECK_FALSE(outsider.is_in_scenario);
  CHECK(outsider.errors[0].rmse.value() == 0.0);
  CHECK_FALSE(outsider.errors[1].rmse.has_value());
  CHECK(has_warning(review, "neglect: 4 steps without"));
  CHECK(has_warning(review, "the truth is known in 3 of 4 steps"));
}

TEST_CASE(
    "losses of every kind are summed and warned of, and so is a process that did not finish") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("log"));
    write_clean_run(log);
    write_status(log, "driver", status_t::FINISHED,
                 {{"frames", 70}, {"lcm_lost", 1}, {"bus_kernel_dropped", 2}, {"unknown", 5}});
    write_status(log, "attacker", status_t::RUNNING,
                 {{"injected", 3}, {"tx_write_dropped", 4}, {"lcm_refused", 6}});
    estimate_t late = make_estimate(1, kTruth);
    std::vector<std::uint8_t> bytes;
    late.seq = 4 + 10;  // ten messages of this channel never reached the logger
    bytes.resize(static_cast<std::size_t>(late.getEncodedSize()));
    late.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    log.write("EST_SECURE", 0, bytes);
  }
  const RunReview review = review_log(folder.file("log"));
  CHECK(review.losses_in_all == 1 + 2 + 4 + 10);
  CHECK(review.refused_by_processes == 6);
  CHECK(review.frames_received.value() == 70);
  CHECK(has_warning(review, "lost: 2 (driver, bus_kernel_dropped)"));
  CHECK(has_warning(review, "lost: 10 (log, missing on EST_SECURE)"));
  CHECK(has_warning(review, "attacker did not finish"));
  CHECK_FALSE(has_warning(review, "driver did not finish"));
}

TEST_CASE("hostile events are counted and change nothing") {
  const TemporaryFolder folder;
  std::string clean_error;
  {
    LogWriter log(folder.file("log"));
    write_clean_run(log);
    estimate_t hostile = make_estimate(2, kTruth);
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(hostile.getEncodedSize()));
    hostile.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    auto huge = bytes;
    huge[8 + 32 + 4 + 8] = 0x7f;  // num_states, behind fingerprint, four int64, outcome, one double
    log.write("EST_SECURE", 0, huge);
    auto negative = bytes;
    negative[8 + 32 + 4 + 8] = 0xff;
    log.write("EST_SECURE", 0, negative);
    log.write("EST_SECURE", 0, {bytes.begin(), bytes.end() - 5});
    log.write("PLANT_TRUTH", 0, {1, 2, 3});
    log.write("STATUS_\x1b[31m", 0, {});
    log.write("CAN_RX", 0, std::vector<std::uint8_t>(64, 0xff));
    log.write("SOMEBODY_ELSES", 0, {1});
  }
  const RunReview review = review_log(folder.file("log"));
  CHECK(review.refused_in_log == 6);
  CHECK(review.troubles.at("EST_SECURE").num_refused() == 3);
  CHECK(review.troubles.at("EST_SECURE").refused.at("bad_length") == 2);
  CHECK(review.troubles.at("PLANT_TRUTH").refused.at("too_short") == 1);
  CHECK(estimator(review, "secure").errors[0].rmse.value() == 5.0);
  CHECK(estimator(review, "secure").num_steps == 4);
  const std::string table = review_table(review);
  CHECK(table.find("datagrams in the log 6") != std::string::npos);
  CHECK(table.find('\x1b') == std::string::npos);
  CHECK(nlohmann::json::parse(review_json(review))["log"]["refused_in_log"] == 6);
}

TEST_CASE("a damaged log and a torn one are read as far as they go") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("log"));
    write_clean_run(log);
  }
  const std::string bytes = read_file(folder.file("log"));
  write_file(folder.file("torn"), bytes.substr(0, bytes.size() - 7));
  const RunReview torn = review_log(folder.file("torn"));
  CHECK(torn.tail_is_torn);
  CHECK(has_warning(torn, "ends in the middle of an event"));
  CHECK(estimator(torn, "secure").num_steps == 4);

  std::string damaged = bytes;
  const std::size_t second = damaged.find("PLANT_TRUTH");
  damaged[second - 28] ^= 0x55;  // sync word of the first truth
  write_file(folder.file("damaged"), damaged);
  const RunReview review = review_log(folder.file("damaged"));
  CHECK(review.damaged_bytes > 0);
  CHECK(has_warning(review, "damaged"));
  CHECK(review.truth_steps == 3);
  CHECK(estimator(review, "secure").num_steps == 3);
}

TEST_CASE("packets are labelled and posteriors are scored against the labels") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("log"));
    write_clean_run(log);
    write_frames(log, "CAN_TX",
                 {make_frame(0, 1, {1}), make_frame(1, 2, {1}), make_frame(2, 3, {9})});
    attack_frame_t attack = make_attack(attack_frame_t::ALTERED, 1, "flip, \"all\"");
    log.write_message("ATTACK_FRAME", 0, attack);
    write_frames(log, "CAN_RX",
                 {make_frame(0, 1, {1}), make_frame(1, 7, {7}), make_frame(2, 2, {1}),
                  make_frame(3, 3, {9})});
    measurement_set_t set{};
    set.step = 1;
    for (const std::int64_t rx_index : {0, 1, 2}) {
      packet_t packet{};
      packet.rx_index = rx_index;
      set.packets.push_back(packet);
    }
    set.num_packets = 3;
    log.write_message("MEASUREMENT", 0, set);
    estimate_t estimate = make_estimate(1, kTruth);
    estimate.packet_rx_index = {0, 1, 2, 500, 0};
    estimate.packet_probability = {0.9, 0.1, 0.2, 0.0,
                                   kInfinity};  // unknown and impossible ones do not count
    estimate.num_packets = 5;
    log.write_message("EST_SCORER", 0, estimate);
  }
  const RunReview review = review_log(folder.file("log"));
  CHECK(review.packet_count.at(PacketLabel::kAuthentic) == 1);
  CHECK(review.packet_count.at(PacketLabel::kForeign) == 1);
  CHECK(review.packet_count.at(PacketLabel::kAltered) == 1);
  CHECK(estimator(review, "SCORER").packets_scored == 3);
  CHECK(estimator(review, "SCORER").packet_auc.value() == 1.0);
  REQUIRE(review.rules.size() == 1);
  CHECK(review.rules[0].frames[0] == 1);
  CHECK(review.frames_touched == 1);
  write_labels_csv(review, folder.file("labels.csv"));
  CHECK(read_file(folder.file("labels.csv")) ==
        "step,rx_index,source,label,tx_index,rule\n"
        "1,0,0,authentic,0,\"\"\n"
        "1,1,0,foreign,-1,\"\"\n"
        "1,2,0,altered,1,\"flip, \"\"all\"\"\"\n");
}

TEST_CASE("a log without RUN_META or with a broken scenario is refused in words") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("none"));
    write_truth(log, 1, kTruth);
    LogWriter broken(folder.file("broken"));
    write_meta(broken, "name: [unclosed");
    LogWriter odd(folder.file("odd"));
    write_meta(odd, "name: 3\nsteps: many\nstate_groups: {a: 1}\nestimators: 5\nplant: [1]\n");
  }
  CHECK_THROWS_AS(review_log(folder.file("none")), UsageError);
  CHECK_THROWS_AS(review_log(folder.file("broken")), UsageError);
  CHECK_THROWS_AS(review_log(folder.file("absent")), UsageError);
  // A scenario of another make: whatever can be said without it is said.
  const RunReview odd = review_log(folder.file("odd"));
  CHECK(odd.estimators.empty());
  CHECK(odd.num_steps == 0);
}

TEST_CASE("the report's files agree with the review") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("log"));
    write_clean_run(log);
  }
  const std::string table = write_review_report(folder.file("log"), folder.file("new/report"));
  CHECK(read_file(folder.file("new/report/review.txt")) == table);
  CHECK(table.find("position m") != std::string::npos);
  const auto json = nlohmann::json::parse(read_file(folder.file("new/report/review.json")));
  CHECK(json["estimators"][0]["name"] == "secure");
  CHECK(json["estimators"][0]["rmse"]["position"]["value"] == 5.0);
  CHECK(json["estimators"][1]["nees_mean"].is_null());
  CHECK(json["frames"]["sent"] == 68);
  const std::string svg = read_file(folder.file("new/report/path.svg"));
  CHECK(svg.find("x position [m]") != std::string::npos);
  CHECK(svg.find("secure") != std::string::npos);
  CHECK_THROWS_AS(write_review_report(folder.file("log"), folder.file("log/report")), JobError);
}

}  // namespace
}  // namespace holdfast
