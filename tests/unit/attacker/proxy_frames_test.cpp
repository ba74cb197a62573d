// Rules on whole frames: their type, bytes and number, bursts, frozen signals and copies.
#include <algorithm>
#include <cmath>
#include <set>

#include "tests/support/catch.h"
#include "tests/support/frames.h"
#include "tests/support/texts.h"
#include "tests/unit/attacker/proxy_bench.h"

using namespace holdfast;
using namespace holdfast::test;

namespace {

std::string rule(const std::string& rest) {
  return "attacks: [{name: r, " + rest + "}]";
}

using testing::frame_of;

std::vector<std::uint8_t> bytes_of(const CanFrame& frame) {
  return {frame.bytes().begin(), frame.bytes().end()};
}

// Steps, from 1, in which the rule acted on the one frame of the step.
std::vector<std::int64_t> steps_of_acts(const std::string& rest, int num_steps,
                                        std::uint64_t seed = 1) {
  const Outcome outcome = run_proxy(
      rules_of(rule(rest)),
      steps_of(num_steps,
               [](int step) { return std::vector<CanFrame>{reading("Flag1", step, "", 0)}; }),
      seed);
  std::vector<std::int64_t> steps;
  for (const AttackRecord& record : outcome.records) steps.push_back(record.step);
  return steps;
}

struct Bursts {
  double share = 0.0, correlation = 0.0;  // of acting, and of acting on neighbours
};
Bursts bursts_of(const std::string& rest, int num_steps) {
  std::vector<double> acted(static_cast<std::size_t>(num_steps), 0.0);
  for (const std::int64_t step : steps_of_acts(rest, num_steps))
    acted[static_cast<std::size_t>(step - 1)] = 1.0;
  double sum = 0.0, products = 0.0;
  for (std::size_t k = 0; k < acted.size(); ++k) {
    sum += acted[k];
    if (k > 0) products += acted[k] * acted[k - 1];
  }
  const double share = sum / num_steps;
  const double variance = share * (1.0 - share);
  return {share, (products / (num_steps - 1) - share * share) / variance};
}

}  // namespace

TEST_CASE("a rule may ask for a type of frame") {
  const std::vector<CanFrame> frames = {
      frame_of(0x400, 0, {1, 2}), frame_of(0x400, CanFrame::kRemote, {}),
      frame_of(0x400, CanFrame::kFd, {1, 2, 3}), frame_of(0x401, CanFrame::kExtended, {1})};
  const auto dropped = [&frames](const std::string& type) {
    std::set<std::int64_t> indices;
    for (const AttackRecord& record :
         run_proxy(rules_of(rule("match: {type: " + type + "}, action: drop")), frames).records)
      indices.insert(record.rx_index);
    return indices;
  };
  CHECK(dropped("any") == std::set<std::int64_t>{0, 1, 2, 3});
  CHECK(dropped("data") == std::set<std::int64_t>{0, 2, 3});
  CHECK(dropped("remote") == std::set<std::int64_t>{1});
  CHECK(dropped("classic") == std::set<std::int64_t>{0, 1, 3});
  CHECK(dropped("fd") == std::set<std::int64_t>{2});
}

TEST_CASE("a rule may compare bytes under a mask") {
  const std::string match = "match: {payload: {at: 1, value: \"12 F0\", mask: \"FF F0\"}}";
  const std::vector<CanFrame> frames = {
      frame_of(0x400, 0, {0, 0x12, 0xF7}), frame_of(0x400, 0, {0, 0x12, 0x07}),
      frame_of(0x400, 0, {0, 0x13, 0xF7}), frame_of(0x400, 0, {0, 0x12}),
      frame_of(0x1ABCDE, CanFrame::kExtended, {9, 0x12, 0xF0, 7})};
  const Outcome outcome = run_proxy(rules_of(rule(match + ", action: drop")), frames);
  REQUIRE(outcome.records.size() == 2);
  CHECK(outcome.records[0].rx_index == 0);
  CHECK(outcome.records[1].rx_index == 4);
}

TEST_CASE("bits are written, kept, set and flipped in that order, and nothing else") {
  const auto after = [](const std::string& edit, const std::vector<std::uint8_t>& before) {
    const Outcome outcome =
        run_proxy(rules_of(rule("action: bits, " + edit)), {frame_of(0x400, 0, before)});
    return bytes_of(outcome.sent.at(0));
  };
  using Bytes = std::vector<std::uint8_t>;
  CHECK(after("set: \"AA BB\"", {1, 2, 3}) == Bytes{0xAA, 0xBB, 3});
  CHECK(after("at: 1, and: \"0F\"", {0xFF, 0xAB, 3}) == Bytes{0xFF, 0x0B, 3});
  CHECK(after("at: 2, or: \"81\"", {1, 2, 0x10}) == Bytes{1, 2, 0x91});
  CHECK(after("xor: FFFF", {0x0F, 0, 1}) == Bytes{0xF0, 0xFF, 1});
  CHECK(after("set: \"3C\", and: \"F0\", or: \"01 80\", xor: \"11\"", {9, 1, 5}) ==
        Bytes{((0x3C & 0xF0) | 0x01) ^ 0x11, 0x81, 5});
  // A frame that is too short stays as it is, without a record.
  const Outcome outcome = run_proxy(rules_of(rule("action: bits, at: 2, set: \"AA BB\"")),
                                    {frame_of(0x400, 0, {1, 2, 3})});
  CHECK(outcome.records.empty());
  CHECK(bytes_of(outcome.sent.at(0)) == Bytes{1, 2, 3});
}

TEST_CASE("every n-th frame, however probable") {
  CHECK(steps_of_acts("action: drop, every: 3", 10) == std::vector<std::int64_t>{3, 6, 9});
  const auto some = steps_of_acts("action: drop, every: 3, probability: 0.5", 3000);
  CHECK(std::all_of(some.begin(), some.end(), [](std::int64_t k) { return k % 3 == 0; }));
  CHECK(std::abs(static_cast<double>(some.size()) - 500.0) < 4.0 * std::sqrt(250.0));
}

TEST_CASE("every n-th step an injection forges all its messages") {
  const Outcome outcome = run_proxy(
      rules_of(rule("match: {messages: [Flag1, Flag2]}, action: inject, every: 2, signal: DETECT, "
                    "value: {value: 1}")),
      steps_of(5, [](int) { return std::vector<CanFrame>{}; }));
  std::vector<std::pair<std::int64_t, std::uint32_t>> forged;
  for (const AttackRecord& record : outcome.records)
    forged.emplace_back(record.step, record.forwarded.identifier);
  CHECK(forged == std::vector<std::pair<std::int64_t, std::uint32_t>>{
                      {2, 257}, {2, 258}, {4, 257}, {4, 258}});
}

TEST_CASE("a chain of two states acts in bursts, with the share and length of its law") {
  constexpr int kSteps = 40000;
  for (const std::string draw : {"frame", "step"}) {
    const Bursts bursts =
        bursts_of("action: drop, draw: " + draw + ", chain: {to_bad: 0.02, to_good: 0.08}", kSteps);
    // The state has the share p / (p + r) and forgets by 1 - p - r a step; 4 standard errors.
    const double memory = 0.9, share = 0.2;
    const double error = std::sqrt(share * (1 - share) / kSteps * (1 + memory) / (1 - memory));
    CHECK(std::abs(bursts.share - share) < 4.0 * error);
    CHECK(std::abs(bursts.correlation - memory) < 0.02);
  }
  const Bursts mixed = bursts_of(
      "action: drop, chain: {to_bad: 0.02, to_good: 0.08, in_bad: 0.5, in_good: 0.1}", kSteps);
  CHECK(mixed.share == Approx(0.2 * 0.5 + 0.8 * 0.1).margin(0.015));
  // Negative control: with one probability neighbours know nothing of each other.
  const Bursts independent = bursts_of("action: drop, probability: 0.2", kSteps);
  CHECK(independent.share == Approx(0.2).margin(0.01));
  CHECK(std::abs(independent.correlation) < 4.0 / std::sqrt(kSteps));
  CHECK(steps_of_acts("action: drop, chain: {to_bad: 0.1, to_good: 0.1}", 200, 1) !=
        steps_of_acts("action: drop, chain: {to_bad: 0.1, to_good: 0.1}", 200, 2));
  CHECK(steps_of_acts("action: drop, chain: {to_bad: 0, to_good: 0.1}", 200).empty());
}

TEST_CASE("a frozen signal stays as it was, all else goes on") {
  const Outcome outcome =
      run_proxy(rules_of(rule("match: {messages: [Level]}, window: {first_step: 3, last_step: 5}, "
                              "action: freeze, signal: LEVEL")),
                steps_of(7, [](int step) {
                  return std::vector<CanFrame>{reading("Level", step, "LEVEL", step)};
                }));
  std::vector<double> levels;
  for (const CanFrame& frame : outcome.sent) {
    if (frame.identifier != 288) continue;
    levels.push_back(value_of(frame, "LEVEL"));
    CHECK(value_of(frame, "STEP") == static_cast<double>(levels.size()));
  }
  CHECK(levels == std::vector<double>{1, 2, 3, 3, 3, 6, 7});
  CHECK(outcome.records.size() == 3);
}

TEST_CASE("copies follow the frame as it was sent, and are counted apart") {
  const Outcome outcome = run_proxy(
      rules_of("attacks: [{name: twice, match: {messages: [Flag1]}, action: duplicate, copies: 2}, "
               "{name: lie, match: {messages: [Flag1]}, window: {first_step: 2}, action: flip, "
               "signal: DETECT}, {name: gone, match: {messages: [Flag1]}, window: {first_step: 3}, "
               "action: drop}]"),
      steps_of(
          3, [](int step) { return std::vector<CanFrame>{reading("Flag1", step, "DETECT", 1)}; }));
  const ProxyCounters& c = outcome.counters;
  CHECK(c.balance());
  CHECK(c.duplicated == 4);
  CHECK(c.passed == 1 + 3);  // the first reading and the ticks
  CHECK(c.altered == 1);
  CHECK(c.dropped == 1);
  REQUIRE(outcome.sent.size() == 3 + 1 + 3 + 1 + 1);
  for (const std::size_t i : {1, 2}) CHECK(outcome.sent[i].same_on_wire(outcome.sent[0]));
  for (const std::size_t i : {4, 5, 6}) CHECK(value_of(outcome.sent[i], "DETECT") == 0.0);
  for (const AttackRecord& record : outcome.records) {
    if (record.tx_index < 0) continue;
    CHECK(
        record.forwarded.same_on_wire(outcome.sent.at(static_cast<std::size_t>(record.tx_index))));
  }
}

TEST_CASE("a value that does not fit its signal is held at the end of the range, and flagged") {
  const auto flags = [](const std::string& rest) {
    std::vector<bool> saturated;
    for (const AttackRecord& record :
         run_proxy(rules_of(rule("match: {messages: [Wide]}, " + rest)),
                   {reading("Wide", 1, "STATE", 2)})
             .records)
      saturated.push_back(record.is_saturated);
    return saturated;
  };
  CHECK(flags("action: add, signal: STATE, value: {value: 1}") == std::vector<bool>{false});
  CHECK(flags("action: add, signal: STATE, value: {value: 2}") == std::vector<bool>{true});
  CHECK(flags("action: substitute, signal: STATE, value: {value: -1}") == std::vector<bool>{true});
}

TEST_CASE("what a rule touched has a right checksum, unless the rule leaves it wrong") {
  FrameLayout layout = test_layout();
  FrameProtection protection;
  protection.message = "Level";
  protection.kind = FrameProtection::Kind::kCrc8J1850;
  protection.checksum_at = 7;
  layout.protection.push_back(protection);
  const auto sound_after = [&](const std::string& rest) {
    ProxyCore proxy(rules_of(rule("match: {messages: [Level]}, signal: LEVEL, " + rest)), layout, 1,
                    0, 1.0);
    CanFrame frame = reading("Level", 1, "LEVEL", 2.0);
    protection.seal({frame.data.data(), frame.num_bytes});
    ProxyOutput out;
    proxy.on_frame(frame, out);
    proxy.on_frame(tick(1), out);
    std::vector<bool> sound;
    for (const CanFrame& sent : out.frames) {
      if (sent.identifier == 288) sound.push_back(protection.is_sound(sent.bytes()));
    }
    return sound;
  };
  CHECK(sound_after("action: add, value: {value: 1}") == std::vector<bool>{true});
  CHECK(sound_after("action: add, repair: false, value: {value: 1}") == std::vector<bool>{false});
  CHECK(sound_after("action: inject, value: {value: 1}") == std::vector<bool>{true, true});
  CHECK(sound_after("action: inject, repair: false, value: {value: 1}") ==
        std::vector<bool>{true, false});
  CHECK(sound_after("action: substitute, probability: 0, value: {value: 1}") ==
        std::vector<bool>{true});
}

TEST_CASE("the truth calls each attack by its class") {
  const auto class_of = [](const std::string& rest) {
    return rules_of(rule(rest)).front().attack_class;
  };
  CHECK(class_of("action: drop") == "suspension");
  CHECK(class_of("action: bits, xor: FF") == "alteration");
  CHECK(class_of("match: {messages: [Flag1]}, action: inject, signal: DETECT, value: {value: 1}") ==
        "fabrication");
  CHECK(class_of("match: {messages: [Flag1]}, action: inject, class: masquerade, signal: DETECT, "
                 "value: {value: 1}") == "masquerade");
  CHECK(class_of("match: {messages: [Level]}, action: substitute, signal: LEVEL, "
                 "value: {distribution: replay, delay_steps: [1, 2]}") == "replay");
}

TEST_CASE("what makes no sense of a frame is refused with its reason") {
  const auto says = [](const std::string& rest, const std::string& text) {
    testing::check_mentions(problems_of(rule(rest)), text);
  };
  says("match: {payload: {mask: \"FF\"}}, action: drop", "value: missing");
  says("match: {payload: {value: \"XY\"}}, action: drop", "pairs of hexadecimal digits");
  says("match: {payload: {value: \"1\"}}, action: drop", "pairs of hexadecimal digits");
  says("match: {payload: {value: \"1122\", mask: \"FF\"}}, action: drop", "as many bytes as value");
  says("match: {type: xl}, action: drop", "none of: any, data, remote, classic, fd");
  says("match: {payload: {at: 63, value: \"1122\"}}, action: drop", "so far back");
  says("match: {messages: [Flag1], type: fd}, action: inject, signal: DETECT, value: {value: 1}",
       "type: an injection compares nothing");
  says("action: bits", "bits needs set, and, or, xor");
  says("action: bits, set: \"0G\"", "pairs of hexadecimal digits");
  says("match: {messages: [Flag1]}, action: bits, at: 2, set: \"0102\"", "has 3 bytes only");
  says("action: duplicate, copies: 0", "copies");
  says("action: drop, every: 0", "every");
  says("action: drop, probability: 0.5, chain: {to_bad: 0.1, to_good: 0.1}", "the chain says it");
  says("action: drop, chain: {to_bad: 1.1}", "to_bad");
  says("action: drop, class: theft", "none of: alteration, fabrication");
  says("action: freeze, signal: NONE", "has a signal 'NONE'");
}
