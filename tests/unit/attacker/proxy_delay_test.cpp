// Frames that are held until a later step: how long, in which order, and that none is lost.
#include <algorithm>
#include <cmath>
#include <map>

#include "tests/support/catch.h"
#include "tests/unit/attacker/proxy_bench.h"

using namespace holdfast;
using namespace holdfast::test;

namespace {

using Disposition = AttackRecord::Disposition;

std::vector<CanFrame> two_kinds(int step) {
  return {reading("Level", step, "LEVEL", step), reading("Flag1", step, "DETECT", 1),
          reading("Level", step, "LEVEL", step + 0.5)};
}

std::string delay_rule(const std::string& rest) {
  return "attacks: [{name: late, match: {messages: [Level]}, action: delay, " + rest + "}]";
}

// The step of the run in which each frame went out, by its index among the sent.
std::vector<std::int64_t> steps_of_sent(const std::vector<CanFrame>& sent) {
  std::vector<std::int64_t> steps;
  std::int64_t step = 1;
  for (const CanFrame& frame : sent) {
    steps.push_back(step);
    if (frame.identifier == 0x7F0) ++step;
  }
  return steps;
}

// Steps between what was read and what was sent, of every Level that came out, by LEVEL.
std::map<double, std::int64_t> delays_of(const Outcome& outcome) {
  const std::vector<std::int64_t> steps = steps_of_sent(outcome.sent);
  std::map<double, std::int64_t> delays;
  for (std::size_t i = 0; i < outcome.sent.size(); ++i) {
    if (outcome.sent[i].identifier != 0x120) continue;
    const double level = value_of(outcome.sent[i], "LEVEL");
    delays[level] = steps[i] - static_cast<std::int64_t>(std::floor(level));
  }
  return delays;
}

std::vector<double> levels_of(const Outcome& outcome) {
  std::vector<double> levels;
  for (const CanFrame& frame : outcome.sent) {
    if (frame.identifier == 0x120) levels.push_back(value_of(frame, "LEVEL"));
  }
  return levels;
}

}  // namespace

TEST_CASE("a constant delay holds every frame for so many steps, in order, before the fresh ones") {
  const Outcome outcome =
      run_proxy(rules_of(delay_rule("delay_steps: 3")), steps_of(20, two_kinds));
  CHECK(outcome.counters.balance());
  CHECK(outcome.counters.held == 40);
  CHECK(outcome.counters.released == 34);  // those of the last three steps are still there
  CHECK(outcome.counters.passed == 40);    // flags and ticks
  for (const auto& [level, delay] : delays_of(outcome)) CHECK(delay == 3);
  const std::vector<double> levels = levels_of(outcome);
  CHECK(levels.size() == 34);
  CHECK(std::ranges::is_sorted(levels));
  // Due frames are the first of their step.
  const std::vector<std::int64_t> steps = steps_of_sent(outcome.sent);
  const auto first = std::ranges::find(steps, 4) - steps.begin();
  CHECK(value_of(outcome.sent[static_cast<std::size_t>(first)], "LEVEL") == 1.0);
}

TEST_CASE("each held frame has two records, that say when it came and when it went") {
  const Outcome outcome = run_proxy(rules_of(delay_rule("delay_steps: [1, 4], class: replay")),
                                    steps_of(30, two_kinds));
  std::map<std::int64_t, const AttackRecord*> held;
  std::int64_t num_released = 0;
  for (const AttackRecord& record : outcome.records) {
    CHECK(record.acted(AttackRule::Action::kDelay));
    if (record.disposition == Disposition::kHeld) {
      held[record.rx_index] = &record;
      CHECK(record.tx_index == -1);
      CHECK(record.forwarded.num_bytes == 0);
      continue;
    }
    REQUIRE(record.disposition == Disposition::kReleased);
    ++num_released;
    REQUIRE(held.contains(record.rx_index));
    CHECK(held[record.rx_index]->original.same_on_wire(record.original));
    CHECK(record.step > held[record.rx_index]->step);
    CHECK(outcome.sent[static_cast<std::size_t>(record.tx_index)].same_on_wire(record.forwarded));
  }
  CHECK(num_released == outcome.counters.released);
  CHECK(static_cast<std::int64_t>(held.size()) == outcome.counters.held);
}

TEST_CASE("drawn delays are uniform where frames may overtake, and keep the order where not") {
  constexpr int kSteps = 3000;
  const auto frames = steps_of(kSteps, two_kinds);
  const Outcome free =
      run_proxy(rules_of(delay_rule("delay_steps: [1, 4], reorder: true")), frames);
  std::map<std::int64_t, double> counts;
  const std::map<double, std::int64_t> delays = delays_of(free);
  for (const auto& [level, delay] : delays) counts[delay] += 1.0;
  const double expected = static_cast<double>(delays.size()) / 4.0;
  double chi_square = 0.0;
  REQUIRE(counts.size() == 4);
  for (const auto& [delay, count] : counts) {
    CHECK(delay >= 1);
    CHECK(delay <= 4);
    chi_square += (count - expected) * (count - expected) / expected;
  }
  CHECK(chi_square < 16.3);  // 3 degrees of freedom, one in a thousand
  // A law that the delays do not have is found out: twice as many of one.
  CHECK(std::abs(counts[1] - 2.0 * expected) > 5.0 * std::sqrt(2.0 * expected));
  CHECK_FALSE(std::ranges::is_sorted(levels_of(free)));

  const Outcome kept = run_proxy(rules_of(delay_rule("delay_steps: [1, 4]")), frames);
  CHECK(std::ranges::is_sorted(levels_of(kept)));
  // Same draws: a frame leaves when its own delay is over, or that of one before it.
  std::int64_t latest = 0;
  for (const auto& [level, delay] : delays_of(kept)) {
    if (!delays.contains(level)) continue;
    const auto step = static_cast<std::int64_t>(std::floor(level));
    latest = std::max(latest, step + delays.at(level));
    CHECK(step + delay == latest);
  }
}

TEST_CASE("a frame that no rule delays waits behind one of its identifier, and only behind that") {
  const std::string rule =
      "attacks: [{name: late, match: {messages: [Level]}, window: {last_step: 1}, times: 1, "
      "action: "
      "delay, delay_steps: 2}]";
  const Outcome outcome = run_proxy(rules_of(rule), steps_of(6, two_kinds));
  CHECK(std::ranges::is_sorted(levels_of(outcome)));
  // 1, 1.5, 2 and 2.5 come with step 3; 1.5, 2 and 2.5 for the first one's sake.
  const auto delays = delays_of(outcome);
  CHECK(delays.at(1.0) == 2);
  CHECK(delays.at(1.5) == 2);
  CHECK(delays.at(2.0) == 1);
  CHECK(delays.at(2.5) == 1);
  CHECK(delays.at(3.0) == 0);
  CHECK(outcome.counters.held == 4);
  CHECK(outcome.counters.balance());
  for (const CanFrame& frame : outcome.sent) {
    if (frame.identifier == 0x101) CHECK(value_of(frame, "DETECT") == 1.0);
  }
  std::string reordering = rule;
  reordering.replace(reordering.find("delay_steps: 2"), 14, "delay_steps: 2, reorder: true");
  CHECK(run_proxy(rules_of(reordering), steps_of(6, two_kinds)).counters.held == 1);
}

TEST_CASE("what other rules do to a delayed frame, they do before it waits; its copies wait, too") {
  const Outcome outcome = run_proxy(
      rules_of(
          "attacks: [{name: late, match: {messages: [Level]}, action: delay, delay_steps: 1}, "
          "{name: more, match: {messages: [Level]}, action: add, signal: LEVEL, value: {value: "
          "100}}, {name: twice, match: {messages: [Level]}, action: duplicate}]"),
      steps_of(2, [](int step) {
        return std::vector<CanFrame>{reading("Level", step, "LEVEL", step)};
      }));
  const std::vector<double> expected = {101.0, 101.0};
  CHECK(levels_of(outcome) == expected);
  CHECK(outcome.counters.balance());
  CHECK(outcome.counters.duplicated == 1);
  const auto copy =
      std::ranges::find(outcome.records, Disposition::kDuplicated, &AttackRecord::disposition);
  REQUIRE(copy != outcome.records.end());
  CHECK(copy->original.same_on_wire(reading("Level", 1, "LEVEL", 1)));
  CHECK(copy->step == 2);
}

TEST_CASE("delays of several rules add up, and probability 0 is no rule") {
  const auto frames = steps_of(12, two_kinds);
  const Outcome both = run_proxy(
      rules_of("attacks: [{name: a, match: {messages: [Level]}, action: delay, delay_steps: 1}, "
               "{name: b, match: {messages: [Level]}, action: delay, delay_steps: 2}]"),
      frames);
  for (const auto& [level, delay] : delays_of(both)) CHECK(delay == 3);
  const Outcome none =
      run_proxy(rules_of(delay_rule("delay_steps: [1, 9], probability: 0")), frames);
  CHECK(same_frames(none.sent, frames));
  CHECK(none.records.empty());
}

TEST_CASE("frames that no rule knows pass while others are held, of any width") {
  CanFrame wide;
  wide.identifier = 0x1ABCDEF0;
  wide.flags = CanFrame::kExtended;
  const auto frames = steps_of(5, [&wide](int step) {
    return std::vector<CanFrame>{reading("Level", step, "LEVEL", step), wide};
  });
  const Outcome outcome = run_proxy(rules_of(delay_rule("delay_steps: 2")), frames);
  CHECK(outcome.counters.passed == 10);
  CHECK(outcome.counters.balance());
}

TEST_CASE("a delay line that is full loses frames, and says so") {
  constexpr auto kMany = static_cast<int>(FrameHold::kFramesMax) + 100;
  std::vector<CanFrame> frames(kMany, reading("Level", 1, "LEVEL", 1));
  frames.push_back(tick(1));
  const Outcome outcome = run_proxy(rules_of(delay_rule("delay_steps: 5")), frames);
  CHECK(outcome.counters.held == static_cast<std::int64_t>(FrameHold::kFramesMax));
  CHECK(outcome.counters.dropped == 100);
  CHECK(outcome.counters.balance());
  CHECK(outcome.records.back().disposition == Disposition::kDropped);
}

TEST_CASE("a wrong delay is told") {
  CHECK(problems_of(delay_rule("probability: 1")).find("delay_steps") != std::string::npos);
  for (const char* wrong : {"0", "[3, 2]", "[1, 2, 3]", "1.5", "[1, 20000]", "-1"}) {
    INFO(wrong);
    CHECK(problems_of(delay_rule(std::string("delay_steps: ") + wrong)) != "");
  }
  CHECK(problems_of(delay_rule("delay_steps: 1, repair: false")).find("repair") !=
        std::string::npos);
  CHECK(problems_of(delay_rule("delay_steps: [2, 2], reorder: false, class: suspension")) == "");
}
