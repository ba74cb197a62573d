// Rules that write several signals of one frame, and rules that replay earlier frames.
#include <cmath>
#include <map>
#include <set>

#include "tests/support/catch.h"
#include "tests/support/texts.h"
#include "tests/unit/attacker/proxy_bench.h"

using namespace holdfast;
using namespace holdfast::test;

namespace {

CanFrame pair(std::int64_t step, double left, double right) {
  CanFrame frame = reading("Pair", step, "LEFT", left);
  const FrameLayout layout = test_layout();
  layout.dbc.find("Pair")->find("RIGHT")->pack({frame.data.data(), frame.num_bytes}, right);
  return frame;
}

double pair_value(const CanFrame& frame, const char* signal) {
  const FrameLayout layout = test_layout();
  return layout.dbc.find("Pair")->find(signal)->unpack(frame.bytes());
}

std::vector<CanFrame> ramp(int num_steps) {
  return steps_of(num_steps, [](int step) -> std::vector<CanFrame> {
    return {pair(step, step, -step), pair(step, 1000.0 + step, 0.0)};
  });
}

}  // namespace

TEST_CASE("one rule writes several signals, each with its own numbers") {
  const Outcome outcome = run_proxy(
      rules_of(pair_rule("action: substitute, signals: [LEFT, RIGHT], value: {value: [3, -4]}")),
      ramp(3));
  REQUIRE(outcome.records.size() == 6);
  for (const AttackRecord& record : outcome.records) {
    CHECK(pair_value(record.forwarded, "LEFT") == 3.0);
    CHECK(pair_value(record.forwarded, "RIGHT") == -4.0);
  }
}

TEST_CASE("signals of one forged frame are independent draws, each in its own range") {
  const Outcome outcome = run_proxy(
      rules_of(pair_rule("action: inject, signals: [LEFT, RIGHT], count: {mean: 20}, value: "
                         "{distribution: uniform, low: [0, -1], high: [1, 1]}")),
      ramp(500));
  double sum_left = 0.0, sum_right = 0.0, sum_product = 0.0;
  int count = 0;
  for (const AttackRecord& record : outcome.records) {
    const double left = pair_value(record.forwarded, "LEFT");
    const double right = pair_value(record.forwarded, "RIGHT");
    REQUIRE((left >= 0.0 && left <= 1.0 && right >= -1.0 && right <= 1.0));
    sum_left += left;
    sum_right += right;
    sum_product += (left - 0.5) * right;
    ++count;
  }
  REQUIRE(count == 10000);
  // 4 standard deviations of each mean.
  CHECK(std::abs(sum_left / count - 0.5) < 4.0 * 0.2887 / 100.0);
  CHECK(std::abs(sum_right / count) < 4.0 * 0.5774 / 100.0);
  CHECK(std::abs(sum_product / count) < 4.0 * 0.2887 * 0.5774 / 100.0);
}

TEST_CASE("the first signal's draws are those of a rule that writes it alone") {
  const auto lefts = [](const std::string& signals) {
    std::vector<double> values;
    const Outcome outcome =
        run_proxy(rules_of(pair_rule("action: substitute, " + signals +
                                     ", value: {distribution: normal, mean: 0, std: 1}")),
                  ramp(20));
    for (const AttackRecord& record : outcome.records) {
      values.push_back(pair_value(record.forwarded, "LEFT"));
    }
    return values;
  };
  CHECK(lefts("signal: LEFT") == lefts("signals: [LEFT, RIGHT]"));
}

TEST_CASE("a replay writes what the first genuine frame of the earlier step held") {
  const Outcome outcome = run_proxy(
      rules_of(pair_rule("action: substitute, signals: [LEFT, RIGHT], value: {distribution: "
                         "replay, delay_steps: [3, 3]}")),
      ramp(10));
  // Steps 1 to 3 have nothing to replay: their frames pass untouched and leave no record.
  REQUIRE(outcome.records.size() == 14);
  CHECK(outcome.counters.passed == 6 + 10);
  for (const AttackRecord& record : outcome.records) {
    CHECK(pair_value(record.forwarded, "LEFT") == static_cast<double>(record.step - 3));
    CHECK(pair_value(record.forwarded, "RIGHT") == -static_cast<double>(record.step - 3));
    CHECK(pair_value(record.forwarded, "STEP") == static_cast<double>(record.step));
  }
}

TEST_CASE("replayed injections take every delay of their range, and the current counter") {
  const Outcome outcome = run_proxy(
      rules_of(pair_rule("action: inject, signals: [LEFT, RIGHT], count: {mean: 5}, value: "
                         "{distribution: replay, delay_steps: [2, 4]}")),
      ramp(300));
  std::map<int, int> delays;
  for (const AttackRecord& record : outcome.records) {
    ++delays[static_cast<int>(static_cast<double>(record.step) -
                              pair_value(record.forwarded, "LEFT"))];
    CHECK(pair_value(record.forwarded, "STEP") == static_cast<double>(record.step));
  }
  REQUIRE(delays.size() == 3);
  for (const int delay : {2, 3, 4}) {
    // Binomial (about 1490, 1/3): 4 standard deviations are 73.
    CHECK(std::abs(delays[delay] - 495) < 80);
  }
}

TEST_CASE("a replay takes genuine values, not those that a rule wrote") {
  const Outcome outcome = run_proxy(
      rules_of("attacks: [{name: lie, match: {messages: [Pair]}, action: substitute, signal: LEFT, "
               "value: {value: 77}}, {name: echo, match: {messages: [Pair]}, action: inject, "
               "signal: LEFT, value: {distribution: replay, delay_steps: [1, 1]}}]"),
      ramp(5));
  int echoes = 0;
  for (const AttackRecord& record : outcome.records) {
    if (record.rule != 1) continue;
    CHECK(pair_value(record.forwarded, "LEFT") == static_cast<double>(record.step - 1));
    ++echoes;
  }
  CHECK(echoes == 4);
}

TEST_CASE("a waveform is added from the window's first step on, to each signal by its gain") {
  const std::string rule = pair_rule(
      "action: add, signals: [LEFT, RIGHT], window: {first_step: 3, last_step: 8}, value: "
      "{distribution: waveform, waveform: ramp, amplitude: 10, offset: 1, gain: [1, -2]}");
  const Outcome passed = run_proxy(rules_of(rule), ramp(10));
  std::map<std::int64_t, int> seen;
  for (const CanFrame& frame : passed.sent) {
    if (frame.identifier != pair(1, 0, 0).identifier) continue;
    const auto step = static_cast<std::int64_t>(pair_value(frame, "STEP"));
    const bool is_first = ++seen[step] == 1;
    const bool is_open = step >= 3 && step <= 8;
    const double added = is_open ? 1.0 + 10.0 * static_cast<double>(step - 3) : 0.0;
    const double left = is_first ? static_cast<double>(step) : 1000.0 + static_cast<double>(step);
    CHECK(std::abs(pair_value(frame, "LEFT") - (left + added)) < 1e-3);
    CHECK(std::abs(pair_value(frame, "RIGHT") -
                   ((is_first ? -static_cast<double>(step) : 0.0) - 2.0 * added)) < 1e-3);
  }
  CHECK(seen.size() == 10);
}

TEST_CASE(
    "a random walk starts at zero and takes independent steps, other ones with another seed") {
  const std::string rule = pair_rule(
      "action: force, signal: LEFT, window: {first_step: 2}, value: {distribution: random_walk, "
      "std: 2}");
  const auto walk_of = [&](std::uint64_t seed) {
    std::vector<double> walk;
    for (const CanFrame& frame : run_proxy(rules_of(rule), ramp(400), seed).sent) {
      if (frame.identifier == pair(1, 0, 0).identifier) walk.push_back(pair_value(frame, "LEFT"));
    }
    return walk;
  };
  const std::vector<double> walk = walk_of(1);
  REQUIRE(walk.size() == 800);  // two frames a step, which share its number
  CHECK(walk[2] == 0.0);
  double sum = 0.0, squares = 0.0, products = 0.0, last = 0.0;
  for (std::size_t k = 4; k < walk.size(); k += 2) {
    CHECK(walk[k] == walk[k + 1]);
    const double step = walk[k] - walk[k - 2];
    sum += step;
    squares += step * step;
    products += step * last;
    last = step;
  }
  const double count = 398.0;
  CHECK(std::abs(sum / count) < 4.0 * 2.0 / std::sqrt(count));
  CHECK(std::abs(squares / count - 4.0) < 4.0 * 4.0 * std::sqrt(2.0 / count));
  CHECK(std::abs(products / count) < 4.0 * 4.0 / std::sqrt(count));
  CHECK(walk_of(1) == walk);
  CHECK(walk_of(2) != walk);
}

TEST_CASE("wrong lists of signals and numbers are told") {
  const auto says = [](const std::string& rest, const std::string& part) {
    testing::check_mentions(problems_of(pair_rule(rest)), part);
  };
  says("action: substitute, signals: [LEFT, LEFT], value: {value: 1}", "each signal once");
  says("action: substitute, signals: [], value: {value: 1}", "must name a signal");
  says("action: substitute, signals: [LEFT], signal: LEFT, value: {value: 1}", "give either");
  says("action: substitute, signals: [LEFT, RIGHT], value: {value: [1, 2, 3]}", "2");
  says(
      "action: substitute, signals: [LEFT, RIGHT], value: {distribution: uniform, low: [0, 2], "
      "high: 1}",
      "below low");
  says("action: substitute, signal: LEFT, value: {distribution: replay}", "delay_steps");
  says("action: substitute, signal: LEFT, value: {distribution: replay, delay_steps: [0, 1]}",
       "delay_steps");
  says("action: substitute, signal: LEFT, value: {distribution: replay, delay_steps: [3, 2]}",
       "[low, high]");
  says("action: substitute, signals: [LEFT, NOSUCH], value: {value: 1}", "NOSUCH");
  says("action: add, signals: [LEFT, RIGHT], value: {distribution: random_walk, std: [1, 2]}",
       "one std");
  says("action: add, signal: LEFT, value: {distribution: waveform, waveform: bumps}", "waveform");
  says("action: add, signal: LEFT, value: {distribution: waveform, draw: step}", "leave draw out");
}
