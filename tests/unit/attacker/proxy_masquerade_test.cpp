// A sender that is silenced, while frames like its own go on at its pace.
#include <algorithm>
#include <functional>

#include "attacker/sender_pace.h"
#include "tests/support/catch.h"
#include "tests/unit/attacker/proxy_bench.h"

using namespace holdfast;
using namespace holdfast::test;

namespace {

std::string masquerade(const std::string& rest) {
  return "attacks: [{name: mask, match: {messages: [Level]}, window: {first_step: 41, last_step: "
         "100}, action: masquerade" +
         rest + "}]";
}

// A sender whose frames in a step are so many, silent or not in the window.
Outcome outcome_of(const std::string& rest, const std::function<int(int step)>& count) {
  return run_proxy(rules_of(masquerade(rest)), steps_of(120, [&](int step) {
                     std::vector<CanFrame> frames = {reading("Flag1", step, "", 0)};
                     for (int i = 0; i < count(step); ++i)
                       frames.push_back(reading("Level", step, "LEVEL", step));
                     return frames;
                   }));
}

std::vector<std::int64_t> forged_steps(const Outcome& outcome) {
  std::vector<std::int64_t> steps;
  for (const AttackRecord& record : outcome.records) {
    if (record.disposition == AttackRecord::Disposition::kInjected) steps.push_back(record.step);
  }
  return steps;
}

}  // namespace

TEST_CASE("frames are forged in the steps and numbers in which the sender would have sent them") {
  struct Sender {
    const char* what;
    std::function<int(int)> count;
  };
  const Sender senders[] = {
      {"one in each step", [](int) { return 1; }},
      {"three in each step", [](int) { return 3; }},
      {"one in every fifth", [](int step) { return step % 5 == 2 ? 1 : 0; }},
      {"two in every fourth", [](int step) { return step % 4 == 0 ? 2 : 0; }}};
  for (const Sender& sender : senders) {
    INFO(sender.what);
    const Outcome outcome = outcome_of(", signal: LEVEL, value: {value: 7}", sender.count);
    std::vector<std::int64_t> expected;
    for (int step = 41; step <= 100; ++step)
      expected.insert(expected.end(), static_cast<std::size_t>(sender.count(step)), step);
    CHECK(forged_steps(outcome) == expected);
    CHECK(outcome.counters.dropped == static_cast<std::int64_t>(expected.size()));
    CHECK(outcome.counters.balance());
    for (const AttackRecord& record : outcome.records) {
      CHECK(record.acted(AttackRule::Action::kMasquerade));
      if (record.tx_index < 0) continue;
      CHECK(value_of(record.forwarded, "LEVEL") == 7.0);
      CHECK(value_of(record.forwarded, "STEP") == static_cast<double>(record.step));
    }
  }
}

TEST_CASE("the pace does not need the sender to go on, and is that of another sender for another") {
  const auto until_40 = [](int every) {
    return [every](int step) { return step <= 40 && step % every == 0 ? 1 : 0; };
  };
  const Outcome fifth = outcome_of("", until_40(5)), fourth = outcome_of("", until_40(4));
  CHECK(forged_steps(fifth).size() == 12);
  CHECK(forged_steps(fourth).size() == 15);
  CHECK(fifth.counters.dropped == 0);
}

TEST_CASE("without a value the last genuine frame is repeated, its counter going on") {
  const Outcome outcome = outcome_of("", [](int) { return 1; });
  for (const AttackRecord& record : outcome.records) {
    if (record.tx_index < 0) continue;
    CHECK(value_of(record.forwarded, "LEVEL") == 40.0);
    CHECK(value_of(record.forwarded, "STEP") == static_cast<double>(record.step));
  }
  // After the window the sender is heard again.
  CHECK(outcome.sent.back().identifier == 0x7F0);
  CHECK(value_of(outcome.sent[outcome.sent.size() - 2], "LEVEL") == 120.0);
}

TEST_CASE("what a sender left out before the window is not made up for, and a gap is no pace") {
  // Silent in steps 21 to 40: no burst at the start of the window.
  const Outcome outcome = outcome_of("", [](int step) { return step <= 20 ? 1 : 0; });
  const std::vector<std::int64_t> steps = forged_steps(outcome);
  CHECK(steps.size() == 60);
  CHECK(std::ranges::adjacent_find(steps) == steps.end());
  SenderPace pace;
  for (std::int64_t step = 1; step <= 50; ++step) pace.learn(step, reading("Level", step, "", 0));
  for (std::int64_t step = 51; step <= 150; ++step) CHECK(pace.due(step) == 1);
  pace.learn(250, reading("Level", 250, "", 0));
  for (std::int64_t step = 251; step <= 270; ++step) CHECK(pace.due(step) == 1);
}

TEST_CASE("a sender is silenced whatever form its frames have") {
  CanFrame remote = reading("Level", 45, "", 0), cut = remote;
  remote.flags |= CanFrame::kRemote;
  cut.num_bytes = 2;
  std::vector<CanFrame> frames = steps_of(
      40, [](int step) { return std::vector<CanFrame>{reading("Level", step, "LEVEL", 1)}; });
  frames.insert(frames.end(), {remote, cut, tick(41)});
  const Outcome outcome = run_proxy(rules_of(masquerade("")), frames);
  CHECK(outcome.counters.dropped == 2);
  CHECK(outcome.counters.injected == 1);
}

TEST_CASE("a sender of whom too little was heard is silenced only") {
  CHECK(forged_steps(outcome_of("", [](int step) { return step >= 41 ? 1 : 0; })).empty());
  CHECK(forged_steps(outcome_of("", [](int step) { return step == 30 ? 1 : 0; })).empty());
  SenderPace pace;
  CHECK(pace.due(3) == 0);
  CHECK(pace.latest() == nullptr);
}

TEST_CASE("a masquerade of a part of the frames is refused") {
  for (const char* key : {"every: 2", "times: 3", "probability: 0.5", "energy: {budget: 1}",
                          "chain: {to_bad: 0.1, to_good: 0.1}"}) {
    INFO(key);
    CHECK(problems_of(masquerade(std::string(", ") + key)).find("all of a sender's frames") !=
          std::string::npos);
  }
  CHECK(
      problems_of("attacks: [{name: a, action: arm}, {name: m, match: {messages: [Level]}, given: "
                  "a, action: masquerade}]")
          .find("all of a sender's") != std::string::npos);
  CHECK(problems_of("attacks: [{name: m, match: {messages: [Level], signal: LEVEL, at_least: 1}, "
                    "action: masquerade}]")
            .find("whatever they hold") != std::string::npos);
  CHECK(problems_of("attacks: [{name: m, match: {identifier: 0x555}, action: masquerade}]")
            .find("message of the DBC") != std::string::npos);
  CHECK(
      problems_of("attacks: [{name: m, match: {messages: [Level]}, action: masquerade}, {name: d, "
                  "given: m, action: drop}]")
          .find("drops") != std::string::npos);
  CHECK(problems_of("attacks: [{name: m, match: {messages: [Level], type: data}, action: "
                    "masquerade}]")
            .find("whatever they hold") != std::string::npos);
  CHECK(rules_of(masquerade(", signal: LEVEL, value: {distribution: replay, delay_steps: 3}"))
            .at(0)
            .attack_class == "masquerade");
  // As it is resolved it reads back.
  ConfigurationDocument document = ConfigurationDocument::from_text(masquerade(""), "t");
  read_attack_rules(document.root(), test_layout());
  document.finish();
  CHECK(problems_of(document.resolved_text()) == "");
}
