#include "tools/log_smoother.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <holdfast/estimate_t.hpp>
#include <holdfast/measurement_set_t.hpp>
#include <iostream>
#include <set>
#include <sstream>
#include <vector>

#include "common/lcm_guard.h"
#include "common/log_file.h"
#include "estimators/attack_assumptions.h"
#include "tests/support/catch.h"
#include "tests/support/temporary_folder.h"
#include "tools/log_fit.h"
#include "tools/run_log.h"

namespace holdfast {
namespace {

std::string scenario(const std::string& name) {
  return std::string(HOLDFAST_SOURCE_DIR) + "/scenarios/" + name + ".yaml";
}

struct Logs {
  testing::TemporaryFolder folder;
  std::string run = folder.file("run.lcm"), smoothed = folder.file("smoothed.lcm");

  explicit Logs(const std::string& name = "turning_target",
                const std::vector<std::string>& overrides = {"steps=30"}) {
    write_run_log(load_experiment(scenario(name), overrides), 0, run);
  }
  LogSmootherOptions options() const {
    LogSmootherOptions options;
    options.log_file = run;
    options.out_file = smoothed;
    return options;
  }
};

std::vector<LogEvent> events_of(const std::string& file) {
  LogReader reader(file);
  std::vector<LogEvent> events;
  LogEvent event;
  while (reader.next(event)) events.push_back(event);
  return events;
}

std::string problem_of(const LogSmootherOptions& options) {
  try {
    smooth_log(options);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "";
}

// What a scenario reads from the text of statistics.
AttackStatistics read_back(const AttackStatistics& statistics) {
  AttackAssumptions read;
  ConfigurationDocument document =
      ConfigurationDocument::from_text(assumes_text(statistics), "fit.yaml");
  read.read(document.root().map("assumes"), 2);
  document.finish();
  return read.periods.front().statistics(2);
}

// What is said on stderr while it lives.
class ErrorCapture {
 public:
  ErrorCapture() : before_(std::cerr.rdbuf(said_.rdbuf())) {}
  ~ErrorCapture() { std::cerr.rdbuf(before_); }
  ErrorCapture(const ErrorCapture&) = delete;
  ErrorCapture& operator=(const ErrorCapture&) = delete;

  std::string text() const { return said_.str(); }

 private:
  std::ostringstream said_;
  std::streambuf* before_;
};

}  // namespace

TEST_CASE("a smoothed log holds all that was there, and each estimate behind its measurements") {
  const Logs logs;
  CHECK(smooth_log(logs.options()) == 6 * 30);
  std::vector<LogEvent> others, before;
  for (LogEvent& event : events_of(logs.run)) {
    const std::set<std::string> unwanted = {"SMOOTHED_UNATTACKED", "SMOOTHED_ORACLE"};
    if (!event.channel.starts_with("SMOOTHED_") || unwanted.contains(event.channel)) {
      before.push_back(std::move(event));
    }
  }
  std::int64_t step = 0;
  int num_smoothed = 0;
  for (LogEvent& event : events_of(logs.smoothed)) {
    measurement_set_t set;
    estimate_t estimate;
    if (event.channel == "MEASUREMENT" && decode_guarded(event.data, set)) step = set.step;
    if (event.channel == "SMOOTHED_MIXTURE") {
      REQUIRE(decode_guarded(event.data, estimate));
      CHECK(estimate.step == step);
      CHECK(estimate.seq == num_smoothed++);
    }
    const std::set<std::string> kept = {"SMOOTHED_UNATTACKED", "SMOOTHED_ORACLE"};
    if (!event.channel.starts_with("SMOOTHED_") || kept.contains(event.channel)) {
      others.push_back(std::move(event));
    }
  }
  CHECK(num_smoothed == 30);
  REQUIRE(others.size() == before.size());
  for (std::size_t i = 0; i < others.size(); ++i) {
    CHECK(others[i].channel == before[i].channel);
    CHECK(others[i].data == before[i].data);
  }
  // Smoothing again replaces; it does not add.
  LogSmootherOptions again = logs.options();
  again.log_file = logs.smoothed;
  again.out_file = logs.folder.file("again.lcm");
  CHECK(smooth_log(again) == 6 * 30);
  CHECK(events_of(again.out_file).size() == events_of(logs.smoothed).size());
}

TEST_CASE("smoothed estimates are stamped as the measurements beside them, whatever the clock") {
  // A live log: stamps of the wall clock, far from the plant's time within the messages.
  const Logs logs;
  constexpr std::int64_t kLater_us = 1'000'000'000'000'000;
  const std::string live = logs.folder.file("live.lcm");
  {
    LogWriter writer(live);
    for (const LogEvent& event : events_of(logs.run)) {
      if (!event.channel.starts_with("SMOOTHED_"))
        writer.write(event.channel, kLater_us + event.utime, event.data);
    }
  }
  for (const std::int64_t lag_steps : {0, 7}) {
    LogSmootherOptions options = logs.options();
    options.log_file = live;
    options.lag_steps = lag_steps;
    CHECK(smooth_log(options) == 6 * 30);
    std::int64_t last_utime = 0, measured_utime = 0;
    int num_smoothed = 0;
    for (const LogEvent& event : events_of(logs.smoothed)) {
      CHECK(event.utime >= last_utime);
      last_utime = event.utime;
      if (event.channel == "MEASUREMENT") measured_utime = event.utime;
      if (!event.channel.starts_with("SMOOTHED_")) continue;
      CHECK(event.utime == measured_utime);
      ++num_smoothed;
    }
    CHECK(measured_utime > kLater_us);
    CHECK(num_smoothed == 6 * 30);
  }
}

TEST_CASE("what cannot be smoothed is refused, and leaves no file") {
  const Logs logs;
  LogSmootherOptions options = logs.options();
  options.name = "nobody";
  CHECK(problem_of(options).find("nobody") != std::string::npos);
  options.name = "oracle";
  CHECK(problem_of(options).find("only a simulation knows") != std::string::npos);
  options = logs.options();
  options.out_file = logs.run;
  CHECK(problem_of(options).find("name another file") != std::string::npos);
  const Logs network("ieee14", {"steps=5"});
  CHECK(problem_of(network.options()).find("key `smoother`") != std::string::npos);
  options = network.options();
  options.name = "hybrid";
  CHECK(problem_of(options).find("cannot look back") != std::string::npos);
  options.name = "nearest";  // a Kalman filter, which can, whatever its scenario says
  CHECK(smooth_log(options) == 5);
  CHECK(!std::filesystem::exists(logs.smoothed));
  CHECK(!std::filesystem::exists(logs.smoothed + ".part"));
  options = logs.options();
  options.log_file = scenario("turning_target");
  CHECK(problem_of(options).find("no LCM log") != std::string::npos);
}

TEST_CASE("a set that is no message is not smoothed by, and is said") {
  const Logs logs("turning_target", {"steps=10"});
  const std::string damaged = logs.folder.file("damaged.lcm");
  {
    LogWriter writer(damaged);
    int num_sets = 0;
    for (LogEvent& event : events_of(logs.run)) {
      if (event.channel == "MEASUREMENT" && ++num_sets == 5) event.data.resize(20);
      writer.write(event.channel, event.utime, event.data);
    }
  }
  LogSmootherOptions options = logs.options();
  options.log_file = damaged;
  const ErrorCapture errors;
  CHECK(smooth_log(options) > 0);
  CHECK(errors.text().find("1 messages on MEASUREMENT are damaged") != std::string::npos);
}

TEST_CASE("a damaged RUN_META is passed over, and is not smoothed by where it is the only one") {
  const Logs logs("turning_target", {"steps=10"});
  std::vector<LogEvent> events = events_of(logs.run);
  REQUIRE(events.front().channel == "RUN_META");
  std::vector<std::uint8_t>& text = events.front().data;
  const std::string number = "steps: 10";
  const auto steps = std::search(text.begin(), text.end(), number.begin(), number.end());
  REQUIRE(steps != text.end());
  const LogEvent whole = events.front();
  *(steps + 7) = '9';
  const std::string damaged = logs.folder.file("damaged.lcm");
  for (const bool is_repeated : {false, true}) {
    {
      LogWriter writer(damaged);
      for (const LogEvent& event : events) writer.write(event.channel, event.utime, event.data);
      if (is_repeated) writer.write(whole.channel, whole.utime, whole.data);
    }
    LogSmootherOptions options = logs.options();
    options.log_file = damaged;
    if (is_repeated) {
      CHECK(smooth_log(options) == 6 * 10);
    } else {
      CHECK(problem_of(options).find("RUN_META is damaged") != std::string::npos);
    }
  }
}

TEST_CASE("a torn and a damaged log are smoothed as far as they go") {
  const Logs logs;
  std::filesystem::resize_file(logs.run, std::filesystem::file_size(logs.run) / 3);
  {
    std::fstream file(logs.run, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(std::filesystem::file_size(logs.run) / 2));
    // Longer than an event, so that the head of one is hit.
    const std::string damage(8000, '!');
    file.write(damage.data(), static_cast<std::streamsize>(damage.size()));
  }
  const ErrorCapture errors;
  const std::int64_t count = smooth_log(logs.options());
  CHECK(errors.text().find("damaged bytes were skipped") != std::string::npos);
  CHECK(errors.text().find("ends in the middle of an event") != std::string::npos);
  CHECK(count > 6 * 10);
  CHECK(count < 6 * 30);
  CHECK(count % 6 == 0);
}

TEST_CASE("a fit of a log climbs and says what it found as a scenario would") {
  const Logs logs("turning_target",
                  {"steps=800", "estimators.mixture.assumes.attack_probability=0.7",
                   "estimators.mixture.assumes.dos_probability=0.6"});
  LogFitOptions options;
  options.log_file = logs.run;
  options.name = "mixture";
  options.rounds_max = 6;
  std::vector<LogFitRound> rounds;
  options.on_round = [&rounds](const LogFitRound& round) { rounds.push_back(round); };
  const LogFitRound last = fit_log(options);
  REQUIRE(rounds.size() == 7);  // the guess, and six more
  CHECK(last.round == 6);
  CHECK(!last.is_converged);
  CHECK(last.change >= options.tolerance);
  for (std::size_t i = 1; i < rounds.size(); ++i) {
    CHECK(rounds[i].log_likelihood > rounds[i - 1].log_likelihood - 1e-3);
  }
  CHECK(rounds.front().statistics.attack_probability == 0.7);
  // The share of forced readings is seen exactly; four standard errors of 800.
  const double forced = last.statistics.attack_probability * last.statistics.dos_probability;
  CHECK(forced == Approx(0.03).margin(4.0 * std::sqrt(0.03 * 0.97 / 800)));
  // Its text can stand in a scenario, where it says the same.
  const AttackStatistics back = read_back(last.statistics);
  CHECK(back.attack_probability == last.statistics.attack_probability);
  CHECK(back.bias_covariance == last.statistics.bias_covariance);
  CHECK(back.scale_std == last.statistics.scale_std);
  // It has converged where a further round changes less than it is told to care for.
  options.tolerance = 1.01 * last.change;
  options.rounds_max = 100;
  const LogFitRound converged = fit_log(options);
  CHECK(converged.is_converged);
  CHECK(converged.change < options.tolerance);
  CHECK(converged.round <= last.round);
  options.name = "gslr";
  CHECK_THROWS_AS(fit_log(options), UsageError);
}

TEST_CASE("what a fit cannot take from an estimator is left out, refused or named") {
  const auto fit_with = [](const std::string& override) {
    const Logs logs("turning_target", {"steps=200", "estimators.mixture." + override});
    LogFitOptions options;
    options.log_file = logs.run;
    options.name = "mixture";
    options.rounds_max = 2;
    return fit_log(options);
  };
  // By one Gaussian that does not learn on the way, whatever the filter does.
  const LogFitRound plain = fit_with("components_max=1");
  for (const char* override : {"components_max=4", "learn_over_steps=100"}) {
    const LogFitRound other = fit_with(override);
    CHECK(other.round == 2);
    CHECK(other.log_likelihood == plain.log_likelihood);
    CHECK(other.statistics.bias_mean == plain.statistics.bias_mean);
  }
  CHECK_THROWS_AS(fit_with("assumes.changes=[{first_step: 100, attack_probability: 0.9}]"),
                  UsageError);
}

TEST_CASE("what a fit cannot move is named, each direction of a bias included") {
  using Names = std::vector<std::string>;
  AttackStatistics guess = AttackStatistics::of_size(2);
  guess.attack_probability = guess.dos_probability = 0.3;
  guess.bias_probability = guess.scale_probability = 0.3;
  guess.scale_std = 0.1;
  guess.bias_covariance << 2.0, 0.5, 0.5, 1.0;
  AttackStatistics next = guess;
  CHECK(unmoved_beliefs(guess, next) == Names{"bias.mean and .covariance", "scale.mean and .std"});
  next.bias_mean[0] += 0.1;
  next.scale_mean += 0.1;
  CHECK(unmoved_beliefs(guess, next).empty());
  guess.bias_covariance << 2.0, 0.0, 0.0, 0.0;
  CHECK(unmoved_beliefs(guess, next) == Names{"bias.mean[1] and .covariance[1]"});
  guess.bias_covariance << 1e-8, 1.0, 1.0, 1e8;
  CHECK(unmoved_beliefs(guess, next) ==
        Names{"bias.mean and .covariance across the directions in which they scatter"});
  guess.bias_covariance << 1e-8, 0.99, 0.99, 1e8;
  guess.scale_probability = 1.0;
  CHECK(unmoved_beliefs(guess, next) == Names{"scale.probability"});
  guess.dos_probability = 1.0;
  CHECK(unmoved_beliefs(guess, next) ==
        Names{"dos_probability", "bias.probability", "scale.probability"});
}

TEST_CASE("what is said not to move does not, and all the rest does") {
  struct Case {
    const char *bias, *unmoved;
    Eigen::Vector2d across;  // direction in which the mean stays; zero: in none
  };
  const Case cases[] = {{"std: 1", "", {0.0, 0.0}},
                        {"std: [1, 0]", "bias.mean[1] and .covariance[1]", {0.0, 1.0}},
                        {"covariance: [[1, 1], [1, 1]]",
                         "bias.mean and .covariance across the directions in which they scatter",
                         {1.0, -1.0}},
                        {"std: 0", "bias.mean and .covariance", {1.0, 1.0}}};
  for (const Case& one : cases) {
    INFO(one.bias);
    const Logs logs("turning_target",
                    {"steps=200", std::string("estimators.mixture.assumes.bias={probability: "
                                              "0.3, mean: [0.5, 0.25], ") +
                                      one.bias + "}"});
    LogFitOptions options;
    options.log_file = logs.run;
    options.name = "mixture";
    options.rounds_max = 3;
    std::vector<LogFitRound> rounds;
    options.on_round = [&rounds](const LogFitRound& round) { rounds.push_back(round); };
    fit_log(options);
    const AttackStatistics &guess = rounds.front().statistics, &last = rounds.back().statistics;
    const std::string unmoved = one.unmoved;
    CHECK(rounds.front().unmoved ==
          (unmoved.empty() ? std::vector<std::string>{} : std::vector{unmoved}));
    const Eigen::Vector2d moved = last.bias_mean - guess.bias_mean;
    CHECK(moved.dot(one.across) == Approx(0.0).margin(1e-12));
    CHECK((moved.norm() > 1e-3) == (unmoved != "bias.mean and .covariance"));
    CHECK(last.bias_probability != guess.bias_probability);
    CHECK(last.attack_probability != guess.attack_probability);
    CHECK(last.scale_mean != guess.scale_mean);
    CHECK(last.scale_std != guess.scale_std);
  }
}

TEST_CASE("beliefs that were fitted stay while the log is smoothed, whatever the filter learns") {
  std::vector<std::vector<double>> smoothed[2];
  for (const int learns : {0, 1}) {
    const Logs logs("turning_target", {"steps=200", std::string("estimators.mixture.learn_over_") +
                                                        "steps=" + (learns != 0 ? "20" : "0")});
    LogSmootherOptions options = logs.options();
    options.name = "mixture";
    options.statistics = AttackStatistics::of_size(2);
    options.statistics->attack_probability = 0.5;
    options.statistics->bias_covariance.setIdentity();
    smooth_log(options);
    estimate_t estimate;
    for (const LogEvent& event : events_of(logs.smoothed)) {
      if (event.channel != "SMOOTHED_MIXTURE") continue;
      REQUIRE(decode_guarded(event.data, estimate));
      smoothed[learns].push_back(estimate.mean);
    }
  }
  CHECK(smoothed[0].size() == 200);
  CHECK(smoothed[0] == smoothed[1]);
}

TEST_CASE("a fit bears biases that scatter little, or lie far away") {
  for (const char* bias : {"{probability: 0.3, mean: [0.7, 0.9], std: 0}",
                           "{probability: 0.3, mean: [5, 5], std: 1e-6}",
                           "{probability: 0.3, mean: [1e5, 1e5], std: 0.01}"}) {
    for (const char* seed : {"seed=1", "seed=3", "seed=4"}) {
      const Logs logs("turning_target",
                      {"steps=200", seed, std::string("estimators.mixture.assumes.bias=") + bias});
      LogFitOptions options;
      options.log_file = logs.run;
      options.name = "mixture";
      options.rounds_max = 4;
      const AttackStatistics fitted = fit_log(options).statistics;
      CHECK(fitted.bias_covariance == fitted.bias_covariance.transpose());
      CHECK(fitted.bias_covariance.diagonal().minCoeff() >= 0.0);
      const AttackStatistics back = read_back(fitted);
      CHECK(back.bias_covariance == fitted.bias_covariance);
      CHECK(back.bias_mean == fitted.bias_mean);
    }
  }
}

}  // namespace holdfast
