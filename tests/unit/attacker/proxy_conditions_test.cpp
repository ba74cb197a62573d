// Rules that act only where an earlier rule did, or did not, and rules that only arm others.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <set>

#include "tests/support/catch.h"
#include "tests/unit/attacker/proxy_bench.h"

using namespace holdfast;
using namespace holdfast::test;

namespace {

using Frames = std::set<std::int64_t>;  // by rx_index

std::vector<CanFrame> flags(int step) {
  return {reading("Flag1", step, "", 0), reading("Flag2", step, "", 0),
          reading("Flag1", step, "", 0), reading("Flag3", step, "", 0)};
}

constexpr int kNumSteps = 300;
constexpr const char* kLetters = "abcdefg";

std::string entry(char name, const std::string& rest) {
  return "{name: " + std::string(1, name) + ", match: {messages: [Flag1, Flag2, Flag3]}, " + rest +
         "}, ";
}

std::string flip_of(char name) {
  return "action: flip, bit: " + std::to_string(8 + (name - 'a'));
}

// Frames on which each rule of a list acted: rule x flips bit 8 + (x - a), or drops.
std::map<char, Frames> acted(const std::string& list) {
  const Outcome outcome =
      run_proxy(rules_of("attacks: [" + list + "]"), steps_of(kNumSteps, flags));
  std::map<char, Frames> result;
  for (const AttackRecord& record : outcome.records) {
    const bool is_dropped = record.disposition == AttackRecord::Disposition::kDropped;
    if (is_dropped) result['x'].insert(record.rx_index);
    for (int i = 0; i < 7 && !is_dropped; ++i) {
      if (((record.original.data[1] ^ record.forwarded.data[1]) >> i & 1) != 0) {
        result[kLetters[i]].insert(record.rx_index);
      }
    }
  }
  return result;
}

// Frames on which a rule with this name decides to act when it stands alone.
Frames alone(char name, const std::string& when) {
  return acted(entry(name, flip_of(name) + ", " + when))[name];
}

Frames both(const Frames& a, const Frames& b) {
  Frames result;
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(),
                        std::inserter(result, result.end()));
  return result;
}

Frames without(const Frames& a, const Frames& b) {
  Frames result;
  std::set_difference(a.begin(), a.end(), b.begin(), b.end(), std::inserter(result, result.end()));
  return result;
}

const std::string kHalf = "probability: 0.5";
const std::string kTogether = "probability: 0.4, draw: step";

}  // namespace

TEST_CASE("a condition takes a part of the frames on which a rule acts alone, and shifts no draw") {
  const Frames a = alone('a', kTogether), b = alone('b', kHalf), c = alone('c', kHalf),
               d = alone('d', kHalf), e = alone('e', kTogether), f = alone('f', kHalf);
  REQUIRE(std::min({a.size(), b.size(), c.size(), d.size(), e.size(), f.size()}) > 300);
  for (const std::string& action : {flip_of('a'), std::string("action: arm")}) {
    auto got = acted(entry('a', action + ", " + kTogether) +
                     entry('b', flip_of('b') + ", given: a, " + kHalf) +
                     entry('c', flip_of('c') + ", unless: [a], " + kHalf) +
                     entry('d', flip_of('d') + ", given: [a, b], " + kHalf) +
                     entry('e', flip_of('e') + ", unless: [b, c], " + kTogether) +
                     entry('f', flip_of('f') + ", given: a, unless: [b, e], " + kHalf));
    const Frames ab = both(a, b), c_not_a = without(c, a),
                 e_rest = without(without(e, ab), c_not_a);
    CHECK(got['a'] == (action == "action: arm" ? Frames{} : a));
    CHECK(got['b'] == ab);
    CHECK(got['c'] == c_not_a);
    CHECK(got['d'] == both(d, ab));
    CHECK(got['e'] == e_rest);
    CHECK(got['f'] == without(both(f, a), [&] {
            Frames either = ab;
            either.insert(e_rest.begin(), e_rest.end());
            return either;
          }()));
  }
}

TEST_CASE("a rule that drops ends the frame for the conditions as well") {
  const Frames a = alone('a', kHalf), b = alone('b', kHalf), c = alone('c', kHalf),
               dropped = acted(entry('x', "action: drop, " + kHalf))['x'];
  REQUIRE(dropped.size() > 300);
  auto got = acted(entry('a', "action: arm, " + kHalf) +
                   entry('b', flip_of('b') + ", given: a, " + kHalf) +
                   entry('x', "action: drop, given: a, unless: b, " + kHalf) +
                   entry('c', flip_of('c') + ", unless: x, given: a, " + kHalf));
  const Frames gone = without(both(dropped, a), b);
  CHECK(got['x'] == gone);
  CHECK(got['b'] == both(a, b));  // none of them was dropped
  CHECK(got['c'] == without(both(c, a), gone));
}

TEST_CASE("arming leaves frames, records and counters alone") {
  const std::vector<CanFrame> frames = steps_of(50, flags);
  for (const char* match : {"", "match: {messages: [Flag1, Wide]}, ",
                            "match: {messages: [Flag1], signal: DETECT, at_most: 0}, "}) {
    const Outcome outcome =
        run_proxy(rules_of("attacks: [{name: a, " + std::string(match) + "action: arm}]"), frames);
    CHECK(same_frames(outcome.sent, frames));
    CHECK(outcome.sent.size() == frames.size());
    CHECK(outcome.records.empty());
    CHECK(outcome.counters.passed == static_cast<std::int64_t>(frames.size()));
    CHECK(outcome.counters.altered == 0);
  }
}

TEST_CASE("an arming rule heeds its window, its match and remote frames") {
  CanFrame remote = reading("Flag1", 1, "", 0);
  remote.flags = CanFrame::kRemote;
  const std::string yaml = R"(
attacks:
  - {name: a, match: {messages: [Flag1], signal: DETECT, at_least: 1}, window: {first_step: 2, last_step: 3}, action: arm}
  - {name: b, given: a, action: drop}
)";
  const Outcome outcome =
      run_proxy(rules_of(yaml), steps_of(5, [&](int step) -> std::vector<CanFrame> {
                  return {reading("Flag1", step, "DETECT", 1), reading("Flag1", step, "DETECT", 0),
                          reading("Flag2", step, "DETECT", 1), remote};
                }));
  REQUIRE(outcome.records.size() == 2);
  CHECK(outcome.records[0].rx_index == 5);
  CHECK(outcome.records[1].rx_index == 10);
  const Outcome plain = run_proxy(
      rules_of("attacks: [{name: a, action: arm}, {name: b, given: a, action: drop}]"), {remote});
  CHECK(plain.counters.dropped == 1);
}

TEST_CASE("a replay that finds nothing has not acted") {
  const Outcome outcome = run_proxy(rules_of(R"(
attacks:
  - {name: echo, match: {messages: [Level]}, action: substitute, signal: LEVEL,
     value: {distribution: replay, delay_steps: [2, 2]}}
  - {name: mark, match: {messages: [Level]}, given: echo, action: add, signal: LEVEL, value: {value: 100}}
  - {name: else, match: {messages: [Level]}, unless: echo, action: force, signal: LEVEL}
)"),
                                    steps_of(4, [](int step) -> std::vector<CanFrame> {
                                      return {reading("Level", step, "LEVEL", step)};
                                    }));
  REQUIRE(outcome.records.size() == 4);
  const double expected[] = {0.0, 0.0, 101.0, 102.0};
  for (std::size_t i = 0; i < 4; ++i) {
    CHECK(value_of(outcome.records[i].forwarded, "LEVEL") == expected[i]);
  }
}

TEST_CASE("each combination of conditional rules comes as often as its probabilities say") {
  const int n = 20000;
  const Outcome outcome = run_proxy(rules_of(R"(
attacks:
  - {name: attack, action: arm, probability: 0.3, draw: step}
  - {name: dos, given: attack, action: force, signals: [LEFT, RIGHT], probability: 0.1, draw: step}
  - {name: bias, given: attack, unless: dos, action: add, signals: [LEFT, RIGHT], probability: 0.3, draw: step,
     value: {value: 1}}
  - {name: scaling, given: attack, unless: dos, action: scale, signals: [LEFT, RIGHT], probability: 0.2, draw: step,
     value: {value: 2}}
)"),
                                    steps_of(n, [](int step) -> std::vector<CanFrame> {
                                      return {reading("Pair", step, "LEFT", 10.0)};
                                    }));
  std::map<double, int> counts;
  for (const CanFrame& frame : outcome.sent) {
    if (frame.identifier == 0x140) ++counts[value_of(frame, "LEFT")];
  }
  const double attacked = 0.3 * 0.9;
  const std::map<double, double> probabilities = {
      {0.0, 0.3 * 0.1},              // forced, never biased or scaled after it
      {11.0, attacked * 0.3 * 0.8},  // biased
      {20.0, attacked * 0.7 * 0.2},  // scaled
      {22.0, attacked * 0.3 * 0.2},  // biased, then scaled: 21 were the other order
      {10.0, 0.7 + attacked * 0.7 * 0.8}};
  REQUIRE(counts.size() == probabilities.size());
  for (const auto& [value, p] : probabilities) {
    INFO(value);
    const double allowed = 4.5 * std::sqrt(n * p * (1.0 - p));  // two-sided 7e-6
    CHECK(std::abs(counts[value] - n * p) < allowed);
    CHECK(std::abs(counts[value] - n * 1.3 * p) > allowed);  // negative control
  }
  CHECK(outcome.counters.altered == n - counts[10.0]);
  for (const AttackRecord& record : outcome.records) REQUIRE(record.rule != 0);
}

TEST_CASE("conditions that name no earlier rule that can hold are told") {
  const auto says = [](const std::string& rest, const std::string& part) {
    const std::string text = problems_of(
        "attacks: [{name: one, action: arm}, {name: two, action: drop}, {name: ghosts, "
        "match: {messages: [Flag1]}, action: inject, signal: DETECT, value: {value: "
        "1}}, {name: me, " +
        rest + "}, {name: later, action: arm}]");
    INFO(text);
    CHECK(text.find(part) != std::string::npos);
  };
  for (const char* name : {"nobody", "later", "me"}) {
    for (const char* key : {"given", "unless"}) {
      says(std::string("action: flip, bit: 0, ") + key + ": [one, " + name + "]",
           std::string("attacks[3].") + key + ": no earlier rule is named '" + name +
               "'; earlier rules: one, two");
    }
  }
  says("action: flip, bit: 0, given: ghosts", "given: 'ghosts' injects");
  says("action: flip, bit: 0, unless: ghosts", "unless: 'ghosts' injects");
  says("action: flip, bit: 0, given: two", "given: 'two' drops");
  says("action: flip, bit: 0, given: one, unless: [two, one]",
       "unless: 'one' stands in given as well");
  says("action: flip, bit: 0, given: {a: 1}", "must be a list");
  says("action: arm, signal: DETECT", "signal: unknown key");
  const std::string first = problems_of("attacks: [{name: a, action: drop, given: b}]");
  CHECK(first.find("earlier rules: none") != std::string::npos);
  CHECK(problems_of("attacks: [{name: a, action: drop}, {name: b, action: drop, unless: a, given: "
                    "[]}]") == "");
}

TEST_CASE("a resolved condition reads back as it was") {
  ConfigurationDocument document = ConfigurationDocument::from_text(
      "attacks: [{name: a, action: arm}, {name: b, action: arm, given: a}, {name: c, action: drop, "
      "given: [a, b]}, {name: d, action: drop, unless: [a]}]",
      "t");
  const auto rules = read_attack_rules(document.root(), test_layout());
  document.finish();
  using Indices = std::vector<std::uint32_t>;
  CHECK(rules[1].given == Indices{0});
  CHECK(rules[2].given == Indices{0, 1});
  CHECK(rules[3].unless == Indices{0});
  CHECK(is_conditional(rules[3]));
  CHECK_FALSE(is_conditional(rules[0]));
  const auto again = rules_of(document.resolved_text());
  for (std::size_t i = 0; i < rules.size(); ++i) {
    CHECK(again[i].given == rules[i].given);
    CHECK(again[i].unless == rules[i].unless);
  }
}

TEST_CASE("an injection's conditions speak of what other rules did in the step") {
  const std::string rules =
      "attacks: [{name: seen, match: {messages: [Level], signal: LEVEL, at_least: 2}, action: "
      "arm}, "
      "{name: gone, match: {messages: [Flag1]}, action: drop, window: {first_step: 4}}, "
      "{name: a, match: {messages: [Flag2]}, action: inject, signal: DETECT, value: {value: 1}, "
      "given: seen, unless: gone}, {name: b, match: {messages: [Flag3]}, action: inject, "
      "signal: DETECT, value: {value: 1}, given: gone}]";
  const Outcome outcome = run_proxy(
      rules_of(rules), steps_of(6, [](int step) {
        return std::vector<CanFrame>{reading("Level", step, "LEVEL", step % 2 == 1 ? 3.0 : 1.0),
                                     reading("Flag1", step, "", 0)};
      }));
  std::vector<std::pair<std::int64_t, std::size_t>> injected;
  for (const AttackRecord& record : outcome.records) {
    if (record.disposition == AttackRecord::Disposition::kInjected)
      injected.emplace_back(record.step, record.rule);
  }
  CHECK(injected ==
        std::vector<std::pair<std::int64_t, std::size_t>>{{1, 2}, {3, 2}, {4, 3}, {5, 3}, {6, 3}});
}

TEST_CASE("a rule acts as often as it may, and no oftener") {
  for (const std::string action : {"flip, signal: DETECT", "drop"}) {
    const Outcome outcome = run_proxy(
        rules_of("attacks: [{name: r, match: {messages: [Flag1]}, times: 3, action: " + action +
                 "}]"),
        steps_of(5, flags));
    REQUIRE(outcome.records.size() == 3);
    CHECK(outcome.records.back().step == 2);
  }
}
