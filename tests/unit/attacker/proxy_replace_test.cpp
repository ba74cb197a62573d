// Rules that take the place of others while frames pass.
#include <algorithm>

#include "tests/support/catch.h"
#include "tests/unit/attacker/proxy_bench.h"

using namespace holdfast;
using namespace holdfast::test;

namespace {

using Disposition = AttackRecord::Disposition;

std::vector<CanFrame> frames_of_step(int step) {
  return {reading("Level", step, "LEVEL", step), reading("Flag1", step, "", 0),
          reading("Flag2", step, "", 0), reading("Flag1", step, "", 0)};
}

const std::string kWalk =
    "{name: walk, match: {messages: [Level]}, action: add, signal: LEVEL, value: {distribution: "
    "random_walk, std: 1}}";
const std::string kFlip =
    "{name: flip, match: {messages: [Flag1, Flag2]}, action: flip, signal: DETECT, probability: "
    "0.4}";
const std::string kThree = "{name: three, match: {messages: [Flag2]}, action: duplicate, times: 3}";

std::vector<AttackRule> list(const std::string& rules) {
  return rules_of("attacks: [" + rules + "]");
}

// Runs 40 steps, the rules being replaced in the middle of step 20.
Outcome run_replaced(const std::string& first, const std::string& then) {
  ProxyCore proxy(list(first), test_layout(), 1, 0, 1.0);
  ProxyOutput out;
  for (int step = 1; step <= 40; ++step) {
    const auto frames = frames_of_step(step);
    for (std::size_t i = 0; i < frames.size(); ++i) {
      if (step == 20 && i == 2) proxy.replace_rules(list(then), test_layout());
      proxy.on_frame(frames[i], out);
    }
    proxy.on_frame(tick(step), out);
  }
  return {out.frames, out.records, proxy.counters()};
}

Outcome run_plain(const std::string& rules) {
  return run_proxy(list(rules), steps_of(40, frames_of_step));
}

}  // namespace

TEST_CASE("rules that are replaced by themselves go on as if nothing had happened") {
  const std::string all = kWalk + ", " + kFlip + ", " + kThree +
                          ", {name: burst, match: {messages: [Flag1]}, action: drop, draw: step, "
                          "chain: {to_bad: 0.2, to_good: 0.3}}, {name: back, match: {messages: "
                          "[Level]}, action: substitute, signal: LEVEL, probability: 0.2, value: "
                          "{distribution: replay, delay_steps: [1, 9]}}";
  const Outcome plain = run_plain(all), replaced = run_replaced(all, all);
  CHECK(same_frames(plain.sent, replaced.sent));
  REQUIRE(plain.records.size() == replaced.records.size());
  for (std::size_t i = 0; i < plain.records.size(); ++i) {
    CHECK(replaced.records[i].rule == plain.records[i].rule);
    CHECK(replaced.records[i].draw == plain.records[i].draw);
    const bool is_after = replaced.records[i].generation == 1;
    CHECK(is_after == (replaced.records[i].step > 20 ||
                       (replaced.records[i].step == 20 && replaced.records[i].rx_index % 5 >= 2)));
  }
}

TEST_CASE("a rule that is added or taken away changes no draw of the others") {
  const Outcome plain = run_plain(kFlip);
  for (const auto& [first, then] :
       {std::pair{kFlip, kWalk + ", " + kFlip}, std::pair{kWalk + ", " + kFlip, kFlip}}) {
    const Outcome replaced = run_replaced(first, then);
    for (std::size_t i = 0; i < plain.sent.size(); ++i) {
      if (plain.sent[i].identifier == 0x120) continue;
      CHECK(plain.sent[i].same_on_wire(replaced.sent[i]));
    }
    const bool is_added = first == kFlip;
    for (const AttackRecord& record : replaced.records) {
      if (record.original.identifier == 0x120) CHECK((record.step > 20) == is_added);
    }
  }
}

TEST_CASE("what a rule has used up stays used up, by its name") {
  CHECK(run_replaced(kThree, kThree).counters.duplicated == 3);
  const std::string other = "{name: more, match: {messages: [Flag2]}, action: duplicate, times: 3}";
  CHECK(run_replaced(kThree, other).counters.duplicated == 6);
  const std::string cheap =
      "{name: e, match: {messages: [Flag2]}, action: drop, energy: {budget: 5}}";
  CHECK(run_replaced(cheap, cheap).counters.dropped == 5);
}

TEST_CASE("frames that are held go out when they are due, though their rule is gone") {
  const std::string late =
      "{name: late, match: {messages: [Level]}, action: delay, delay_steps: 5}";
  const Outcome outcome = run_replaced(kFlip + ", " + late, kFlip);
  CHECK(outcome.counters.balance());
  CHECK(outcome.counters.held == outcome.counters.released);
  std::int64_t last_released = 0;
  for (const AttackRecord& record : outcome.records) {
    if (record.disposition != Disposition::kReleased) continue;
    last_released = std::max(last_released, record.step);
  }
  // Those of step 20 were held; fresh ones wait behind them until then, and then no more.
  CHECK(last_released == 25);
  std::vector<double> levels;
  for (const CanFrame& frame : outcome.sent) {
    if (frame.identifier == 0x120) levels.push_back(value_of(frame, "LEVEL"));
  }
  CHECK(levels.size() == 40);
  CHECK(std::ranges::is_sorted(levels));
}

TEST_CASE("a paused rule does nothing and remembers all") {
  ProxyCore proxy(list(kThree), test_layout(), 1, 0, 1.0);
  ProxyOutput out;
  std::int64_t duplicated_when_paused = 0;
  for (int step = 1; step <= 12; ++step) {
    if (step == 3 || step == 8) {
      std::vector<AttackRule> rules = list(kThree);
      rules[0].is_paused = step == 3;
      proxy.replace_rules(std::move(rules), test_layout());
    }
    for (const CanFrame& frame : frames_of_step(step)) proxy.on_frame(frame, out);
    proxy.on_frame(tick(step), out);
    if (step == 7) duplicated_when_paused = proxy.counters().duplicated;
  }
  CHECK(duplicated_when_paused == 2);
  CHECK(proxy.counters().duplicated == 3);
  CHECK(proxy.generation() == 2);
  CHECK(proxy.num_acts(0) == 3);
}

TEST_CASE("where all rules pause, what is held goes out with the next frame, and nothing waits") {
  ProxyCore proxy(list("{name: late, match: {messages: [Level]}, action: delay, delay_steps: 500}"),
                  test_layout(), 1, 0, 1.0);
  ProxyOutput out;
  for (int step = 1; step <= 12; ++step) {
    if (step == 9) {
      std::vector<AttackRule> rules = proxy.rules();
      rules[0].is_paused = true;
      proxy.replace_rules(std::move(rules), test_layout());
    }
    for (const CanFrame& frame : frames_of_step(step)) proxy.on_frame(frame, out);
    proxy.on_frame(tick(step), out);
  }
  CHECK(proxy.num_held() == 0);
  CHECK(proxy.counters().held == 8);
  CHECK(proxy.counters().released == 8);
  CHECK(proxy.counters().balance());
  std::vector<double> levels;
  for (const CanFrame& frame : out.frames) {
    if (frame.identifier == 0x120) levels.push_back(value_of(frame, "LEVEL"));
  }
  CHECK(levels.size() == 12);
  CHECK(std::ranges::is_sorted(levels));
}

TEST_CASE("a held frame keeps the rule that holds it, whatever takes that rule's name") {
  const std::string late =
      "{name: x, match: {messages: [Level]}, action: delay, delay_steps: 5, class: suspension}";
  ProxyCore proxy(list(late), test_layout(), 1, 0, 1.0);
  ProxyOutput out;
  for (const CanFrame& frame : frames_of_step(1)) proxy.on_frame(frame, out);
  const auto swap = [&proxy](const std::string& rules) {
    proxy.replace_rules(list(rules), test_layout());
  };
  swap("{name: x, match: {messages: [Flag1]}, action: drop}");
  REQUIRE(proxy.rules().size() == 2);
  for (int i = 0; i < 50; ++i)  // rules that nothing names are not kept
    swap("{name: y" + std::to_string(i) + ", match: {messages: [Flag1]}, action: drop}");
  CHECK(proxy.rules().size() == 2);
  out.clear();
  for (int step = 1; step <= 6; ++step) {
    if (step > 1) proxy.on_frame(reading("Flag2", step, "", 0), out);
    proxy.on_frame(tick(step), out);
  }
  REQUIRE(out.records.size() == 1);
  CHECK(out.records[0].disposition == Disposition::kReleased);
  CHECK(proxy.rules()[out.records[0].rule].name == "x");
  CHECK(proxy.rules()[out.records[0].rule].action == AttackRule::Action::kDelay);
}

TEST_CASE("a rule that was taken away and comes again starts anew") {
  const auto three = list(kThree);
  ProxyCore proxy(list(kThree + ", {name: late, match: {messages: [Level]}, action: delay, "
                                "delay_steps: 100}"),
                  test_layout(), 1, 0, 1.0);
  ProxyOutput out;
  for (int step = 1; step <= 12; ++step) {
    if (step == 6) proxy.replace_rules({}, test_layout());
    if (step == 7) proxy.replace_rules(three, test_layout());
    for (const CanFrame& frame : frames_of_step(step)) proxy.on_frame(frame, out);
    proxy.on_frame(tick(step), out);
  }
  CHECK(proxy.counters().duplicated == 6);
}

TEST_CASE("to pause and resume within a step moves nothing on") {
  const std::string rules = kWalk +
                            ", {name: burst, match: {messages: [Flag1]}, action: drop, draw: step, "
                            "chain: {to_bad: 0.5, to_good: 0.5}}";
  const auto run = [&rules](bool interrupts) {
    ProxyCore proxy(list(rules), test_layout(), 1, 0, 1.0);
    ProxyOutput out;
    for (int step = 1; step <= 30; ++step) {
      for (const bool is_paused : {true, false}) {
        if (!interrupts) break;
        std::vector<AttackRule> again = list(rules);
        for (AttackRule& rule : again) rule.is_paused = is_paused;
        proxy.replace_rules(std::move(again), test_layout());
      }
      for (const CanFrame& frame : frames_of_step(step)) proxy.on_frame(frame, out);
      proxy.on_frame(tick(step), out);
    }
    return out.frames;
  };
  CHECK(same_frames(run(true), run(false)));
}
