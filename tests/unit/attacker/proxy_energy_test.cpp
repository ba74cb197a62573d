// What a rule may spend: never more than its budget, and all of it where it can.
#include <cmath>

#include "tests/support/catch.h"
#include "tests/unit/attacker/proxy_bench.h"

using namespace holdfast;
using namespace holdfast::test;

namespace {

std::vector<CanFrame> pairs(int step) {
  return {reading("Pair", step, "LEFT", 1.0), reading("Pair", step, "RIGHT", 2.0)};
}

double spent(const Outcome& outcome) {
  double sum = 0.0;
  for (const AttackRecord& record : outcome.records) {
    for (const char* signal : {"LEFT", "RIGHT"}) {
      const double added = value_of(record.forwarded, signal) - value_of(record.original, signal);
      sum += added * added;
    }
  }
  return sum;
}

const std::string kAddNormal =
    "action: add, signals: [LEFT, RIGHT], value: {distribution: normal, mean: 0, std: 1}";

}  // namespace

TEST_CASE("an attack spends no more than its budget, and nearly all of it") {
  for (const double budget : {3.0, 50.0}) {
    const Outcome outcome = run_proxy(
        rules_of(pair_rule(kAddNormal + ", energy: {budget: " + std::to_string(budget) + "}")),
        steps_of(200, pairs));
    CHECK(spent(outcome) <= budget);
    // What is left does not suffice for one of many draws, the smallest of which are near 0.
    CHECK(spent(outcome) > 0.9 * budget);
  }
  // Without a budget the same rule spends two for each frame.
  CHECK(spent(run_proxy(rules_of(pair_rule(kAddNormal)), steps_of(200, pairs))) > 600.0);
}

TEST_CASE("a budget shifts no draw: what is added is what would have been added, or nothing") {
  const auto frames = steps_of(50, pairs);
  const Outcome all = run_proxy(rules_of(pair_rule(kAddNormal)), frames);
  const Outcome some =
      run_proxy(rules_of(pair_rule(kAddNormal + ", energy: {budget: 20}")), frames);
  REQUIRE(some.records.size() < all.records.size());
  for (const AttackRecord& record : some.records) {
    CHECK(record.forwarded.same_on_wire(all.sent[static_cast<std::size_t>(record.tx_index)]));
  }
  const Outcome ample =
      run_proxy(rules_of(pair_rule(kAddNormal + ", energy: {budget: 1.0e9}")), frames);
  CHECK(same_frames(ample.sent, all.sent));
}

TEST_CASE("a budget that fills up again bounds the mean power") {
  const Outcome outcome = run_proxy(
      rules_of(pair_rule("action: add, signal: LEFT, value: {value: 2}, energy: {budget: 8, "
                         "refill_per_step: 1}")),
      steps_of(100, pairs));
  // Two at once; then one for every four steps.
  CHECK(spent(outcome) <= 8.0 + 99.0);
  CHECK(spent(outcome) >= 99.0);
  CHECK(outcome.records[0].step == 1);
  CHECK(outcome.records[1].step == 1);
  CHECK(outcome.records[2].step == 5);
  CHECK(outcome.records[3].step == 9);
}

TEST_CASE("what writes no value costs one for each frame") {
  for (const std::string action : {"drop", "flip, bit: 3", "delay, delay_steps: 1", "duplicate",
                                   "inject, signal: LEFT, value: {value: 1}"}) {
    INFO(action);
    const Outcome outcome =
        run_proxy(rules_of(pair_rule("action: " + action + ", energy: {budget: 3}")),
                  steps_of(20, [](int step) {
                    return std::vector<CanFrame>{reading("Pair", step, "LEFT", 1.0)};
                  }));
    const ProxyCounters& c = outcome.counters;
    CHECK(c.dropped + c.altered + c.held + c.duplicated + c.injected == 3);
    CHECK(c.balance());
  }
}

TEST_CASE("a change that alone exceeds the budget never happens") {
  const std::string rule = "action: add, signal: LEFT, value: {value: 1.0e200}";
  // float32 ends at 3.4e38.
  CHECK(run_proxy(rules_of(pair_rule(rule + ", energy: {budget: 1.0e300}")), steps_of(5, pairs))
            .records.size() == 10);
  CHECK(run_proxy(rules_of(pair_rule(rule + ", energy: {budget: 1.0e76}")), steps_of(5, pairs))
            .records.empty());
}

TEST_CASE("a wrong budget is told") {
  CHECK(problems_of(pair_rule("action: drop, energy: {refill_per_step: 1}")).find("budget") !=
        std::string::npos);
  CHECK(problems_of(pair_rule("action: drop, energy: {budget: -1}")) != "");
  CHECK(problems_of(pair_rule("action: drop, energy: {budget: 0.5}")).find("never act") !=
        std::string::npos);
  CHECK(problems_of(pair_rule("action: arm, energy: {budget: 1}")).find("costs nothing") !=
        std::string::npos);
}
