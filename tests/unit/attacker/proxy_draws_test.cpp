#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <tuple>

#include "attacker/proxy_core.h"
#include "tests/support/catch.h"
#include "tests/unit/attacker/proxy_bench.h"

using namespace holdfast;
using namespace holdfast::test;

namespace {

using Fate = std::tuple<std::int64_t, std::uint32_t, std::int64_t>;  // step, identifier, index

// Frames that this rule touched or dropped.
std::vector<Fate> fates(const Outcome& outcome, std::size_t rule) {
  std::vector<Fate> list;
  for (const AttackRecord& record : outcome.records) {
    if (record.rule == rule)
      list.emplace_back(record.step, record.original.identifier, record.draw_index);
  }
  std::sort(list.begin(), list.end());
  return list;
}

std::vector<CanFrame> flags_and_level(int step) {
  return {reading("Flag1", step, "DETECT", 1), reading("Flag2", step, "DETECT", 0),
          reading("Flag1", step, "DETECT", 0), reading("Level", step, "LEVEL", step),
          reading("Flag3", step, "DETECT", 1)};
}

const char* const kDropHalf =
    "{name: drop, match: {messages: [Flag1, Flag2, Flag3]}, action: drop, probability: 0.5}";

// Values that a rule writes into LEVEL, one per step.
std::vector<double> written_values(const std::string& action, int num_steps) {
  const Outcome outcome = run_proxy(
      rules_of("attacks: [{name: r, match: {messages: [Level]}, signal: LEVEL, " + action + "}]"),
      steps_of(num_steps, [](int step) -> std::vector<CanFrame> {
        return {reading("Level", step, "LEVEL", 0)};
      }));
  std::vector<double> values;
  for (const AttackRecord& record : outcome.records)
    values.push_back(value_of(record.forwarded, "LEVEL"));
  return values;
}

// Kolmogorov-Smirnov distance between a sample and a distribution function.
double distance(std::vector<double> sample, const std::function<double(double)>& cdf) {
  std::sort(sample.begin(), sample.end());
  const double n = static_cast<double>(sample.size());
  double largest = 0.0;
  for (std::size_t i = 0; i < sample.size(); ++i) {
    const double p = cdf(sample[i]);
    largest = std::max({largest, std::abs(p - static_cast<double>(i) / n),
                        std::abs(p - static_cast<double>(i + 1) / n)});
  }
  return largest;
}

// Distance that a true sample exceeds with probability 1e-4: sqrt(ln(2 / level) / (2 n)).
double allowed_distance(std::size_t n) {
  return std::sqrt(std::log(2.0 / 1e-4) / (2.0 * static_cast<double>(n)));
}

}  // namespace

TEST_CASE("one seed gives one set of decisions; another seed, run or rule name gives another") {
  const std::vector<CanFrame> frames = steps_of(100, flags_and_level);
  const auto rules = rules_of("attacks: [" + std::string(kDropHalf) + "]");
  const std::vector<Fate> first = fates(run_proxy(rules, frames, 7), 0);
  CHECK(first == fates(run_proxy(rules, frames, 7), 0));
  CHECK(first != fates(run_proxy(rules, frames, 8), 0));
  CHECK(first != fates(run_proxy(rules, frames, 7, 1), 0));
  auto renamed = rules;
  renamed[0].name = "other";
  CHECK(first != fates(run_proxy(renamed, frames, 7), 0));
}

TEST_CASE("a rule that is added, before or after, shifts no draw of another rule") {
  const std::vector<CanFrame> frames = steps_of(100, flags_and_level);
  const std::vector<Fate> alone =
      fates(run_proxy(rules_of("attacks: [" + std::string(kDropHalf) + "]"), frames), 0);
  const std::string noise =
      "{name: noise, action: flip, bit: 1, probability: 0.3}, "
      "{name: ghosts, match: {messages: [Flag1, Level]}, action: inject, signal: STEP, value: "
      "{value: 1}, "
      "count: {distribution: poisson, mean: 2}}";
  CHECK(alone ==
        fates(run_proxy(rules_of("attacks: [" + noise + ", " + kDropHalf + "]"), frames), 2));
  CHECK(
      alone ==
      fates(run_proxy(rules_of("attacks: [" + std::string(kDropHalf) + ", " + noise + "]"), frames),
            0));
}

TEST_CASE("the order among identifiers within a step decides nothing") {
  const std::string yaml = R"(
attacks:
  - {name: drop, match: {messages: [Flag1, Flag2, Flag3]}, action: drop, probability: 0.4}
  - {name: lie, match: {messages: [Level]}, action: substitute, signal: LEVEL, probability: 0.5,
     value: {distribution: normal, mean: 0, std: 1}}
  - {name: all, action: flip, bit: 2, probability: 0.3, draw: step}
)";
  // Stable sort by identifier keeps the order within one identifier, and changes it among them.
  const auto reordered = [](int step) {
    std::vector<CanFrame> frames = flags_and_level(step);
    const std::uint32_t turn = static_cast<std::uint32_t>(step % 4) * 7;
    std::stable_sort(frames.begin(), frames.end(), [turn](const CanFrame& a, const CanFrame& b) {
      return ((a.identifier + turn) & 31) < ((b.identifier + turn) & 31);
    });
    return frames;
  };
  using Key = std::tuple<std::int64_t, std::uint32_t, std::int64_t>;
  const auto table = [](const Outcome& outcome) {
    std::map<Key, std::vector<std::uint8_t>> result;
    for (const AttackRecord& record : outcome.records) {
      std::vector<std::uint8_t>& bytes =
          result[{record.step, record.original.identifier, record.draw_index}];
      bytes.assign(record.forwarded.bytes().begin(), record.forwarded.bytes().end());
      bytes.push_back(static_cast<std::uint8_t>(record.disposition));
      bytes.push_back(static_cast<std::uint8_t>(record.rule));
    }
    return result;
  };
  const std::vector<CanFrame> a = steps_of(60, flags_and_level), b = steps_of(60, reordered);
  REQUIRE_FALSE(same_frames(a, b));
  const auto fates_a = table(run_proxy(rules_of(yaml), a));
  CHECK(fates_a.size() > 60);
  CHECK(fates_a == table(run_proxy(rules_of(yaml), b)));
}

TEST_CASE("draw: step takes all frames of a step or none; draw: frame does not") {
  const auto split_steps = [](const char* draw) {
    const Outcome outcome =
        run_proxy(rules_of("attacks: [{name: d, match: {messages: [Flag1, Flag2, Flag3]}, action: "
                           "drop, probability: 0.5, draw: " +
                           std::string(draw) + "}]"),
                  steps_of(200, flags_and_level));
    std::map<std::int64_t, int> per_step;
    for (const AttackRecord& record : outcome.records) ++per_step[record.step];
    // 4 standard deviations of a binomial (200, 0.5): 28.3; with single draws a step has four
    // chances.
    if (std::string(draw) == "step") CHECK(std::abs(static_cast<int>(per_step.size()) - 100) < 29);
    return std::count_if(per_step.begin(), per_step.end(),
                         [](const auto& entry) { return entry.second != 4; });
  };
  CHECK(split_steps("step") == 0);
  CHECK(split_steps("frame") > 100);
}

TEST_CASE("a rule acts with its probability") {
  const int num_steps = 5000;
  const Outcome outcome = run_proxy(rules_of("attacks: [{name: d, match: {messages: [Flag1, Flag2, "
                                             "Flag3]}, action: drop, probability: 0.15}]"),
                                    steps_of(num_steps, flags_and_level));
  const double n = 4.0 * num_steps;
  const double frequency = static_cast<double>(outcome.counters.dropped) / n;
  const double allowed = 4.0 * std::sqrt(0.15 * 0.85 / n);  // two-sided 6e-5
  CHECK(std::abs(frequency - 0.15) < allowed);
  CHECK(std::abs(frequency - 0.17) > allowed);  // negative control
}

TEST_CASE("decisions of two frames of one identifier, and of two identifiers, are independent") {
  const int num_steps = 5000;
  const Outcome outcome = run_proxy(rules_of("attacks: [" + std::string(kDropHalf) + "]"),
                                    steps_of(num_steps, flags_and_level));
  const std::vector<Fate> list = fates(outcome, 0);
  const auto hit = [&list](std::int64_t step, std::uint32_t identifier, std::int64_t index) {
    return std::binary_search(list.begin(), list.end(), Fate{step, identifier, index});
  };
  int same_identifier = 0, other_identifier = 0, itself = 0;
  for (int step = 1; step <= num_steps; ++step) {
    same_identifier += hit(step, 0x101, 0) == hit(step, 0x101, 1);
    other_identifier += hit(step, 0x101, 0) == hit(step, 0x102, 0);
    itself += hit(step, 0x101, 0) == hit(step, 0x101, 0);
  }
  const double allowed = 4.0 * std::sqrt(0.25 * num_steps);
  CHECK(std::abs(same_identifier - 0.5 * num_steps) < allowed);
  CHECK(std::abs(other_identifier - 0.5 * num_steps) < allowed);
  CHECK(std::abs(itself - 0.5 * num_steps) > allowed);  // negative control: full dependence
}

TEST_CASE("substituted values follow their distribution") {
  const int n = 20000;
  const auto normal = [](double mean, double std) {
    return [=](double x) { return 0.5 * std::erfc((mean - x) / (std * std::numbers::sqrt2)); };
  };
  const auto uniform = [](double low, double high) {
    return [=](double x) { return (x - low) / (high - low); };
  };

  const std::vector<double> flat =
      written_values("action: substitute, value: {distribution: uniform, low: -2, high: 3}", n);
  REQUIRE(flat.size() == static_cast<std::size_t>(n));
  CHECK(distance(flat, uniform(-2, 3)) < allowed_distance(flat.size()));
  CHECK(distance(flat, uniform(-2, 3.2)) > allowed_distance(flat.size()));

  const std::vector<double> bell =
      written_values("action: substitute, value: {distribution: normal, mean: 1, std: 2}", n);
  CHECK(distance(bell, normal(1, 2)) < allowed_distance(bell.size()));
  CHECK(distance(bell, normal(1, 2.2)) > allowed_distance(bell.size()));

  const std::vector<double> coin =
      written_values("action: substitute, value: {distribution: bernoulli, probability: 0.3}", n);
  const double ones = static_cast<double>(std::count(coin.begin(), coin.end(), 1.0));
  CHECK(ones + static_cast<double>(std::count(coin.begin(), coin.end(), 0.0)) == n);
  const double allowed = 4.0 * std::sqrt(n * 0.3 * 0.7);
  CHECK(std::abs(ones - 0.3 * n) < allowed);
  CHECK(std::abs(ones - 0.32 * n) > allowed);

  for (const double value :
       written_values("action: substitute, value: {distribution: constant, value: 2.5}", 5)) {
    CHECK(value == 2.5);
  }
}

TEST_CASE("forged values follow their distribution, each of its own draw") {
  const std::vector<double> flat = written_values(
      "action: inject, count: {mean: 20}, value: {distribution: uniform, low: 0, high: 1}", 1000);
  REQUIRE(flat.size() == 20000);
  CHECK(distance(flat, [](double x) { return x; }) < allowed_distance(flat.size()));
  std::vector<double> sorted = flat;
  std::sort(sorted.begin(), sorted.end());
  // 20000 draws of a 24-bit float collide about 12 times; a shared draw would leave 1000 values.
  CHECK(std::unique(sorted.begin(), sorted.end()) - sorted.begin() > 19900);
}

TEST_CASE("values do not depend on the decision or the count that were drawn before them") {
  const auto uniform = [](double x) { return x; };
  // Were the value's draw the decision's, only the lower half of the interval would be written.
  const std::vector<double> decided = written_values(
      "probability: 0.5, action: substitute, value: {distribution: uniform, low: 0, high: 1}",
      20000);
  CHECK(decided.size() > 9000);
  CHECK(distance(decided, uniform) < allowed_distance(decided.size()));
  // Were it the count's, a step with a forgery would have a value above exp(-0.5).
  const std::vector<double> counted = written_values(
      "action: inject, count: {distribution: poisson, mean: 0.5}, value: {distribution: uniform, "
      "low: 0, high: 1}",
      20000);
  CHECK(counted.size() > 9000);
  CHECK(distance(counted, uniform) < allowed_distance(counted.size()));
}

TEST_CASE("the number of forged frames is Poisson") {
  const int num_steps = 5000;
  const double mean = 1.5;
  const Outcome outcome =
      run_proxy(rules_of("attacks: [{name: i, match: {messages: [Flag1]}, action: inject, signal: "
                         "DETECT, value: {value: 1}, "
                         "count: {distribution: poisson, mean: 1.5}}]"),
                steps_of(num_steps, [](int) { return std::vector<CanFrame>{}; }));
  std::map<std::int64_t, int> per_step;
  for (const AttackRecord& record : outcome.records) ++per_step[record.step];
  const double n = num_steps;
  const double measured = static_cast<double>(outcome.counters.injected) / n;
  const double allowed = 4.0 * std::sqrt(mean / n);
  CHECK(std::abs(measured - mean) < allowed);
  CHECK(std::abs(measured - 1.6) > allowed);  // negative control
  const double p_none = std::exp(-mean);
  const double none = n - static_cast<double>(per_step.size());
  CHECK(std::abs(none - n * p_none) < 4.0 * std::sqrt(n * p_none * (1.0 - p_none)));
}
