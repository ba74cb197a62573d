#include "attacker/attack_messages.h"

#include <holdfast/attack_frame_t.hpp>

#include "tests/support/catch.h"
#include "tests/unit/attacker/proxy_bench.h"

using namespace holdfast;
using namespace holdfast::test;

TEST_CASE("an attack record survives the way through its message") {
  const std::vector<AttackRule> rules = rules_of(R"(
attacks:
  - {name: lie, match: {messages: [Flag1]}, action: flip, signal: DETECT, probability: 0.9}
  - {name: cut, match: {messages: [Flag2]}, action: drop}
  - {name: ghost, match: {messages: [Level]}, action: inject, signal: LEVEL, value: {value: 1.0e300}}
  - {name: twice, match: {messages: [Flag1]}, action: duplicate, window: {last_step: 1}}
)");
  const std::vector<CanFrame> frames = steps_of(3, [](int step) -> std::vector<CanFrame> {
    return {reading("Flag1", step, "DETECT", 1), reading("Flag2", step, "DETECT", 1)};
  });
  const Outcome outcome = run_proxy(rules, frames);
  REQUIRE(outcome.records.size() >= 7);
  attack_frame_t message;
  for (const AttackRecord& record : outcome.records) {
    to_message(record, rules, 0.5, message);
    CHECK(message.utime == record.step * 500000);
    CHECK(message.rule == rules[record.rule].name);
    CHECK(message.action == to_string(rules[record.rule].action));
    AttackRecord back;
    REQUIRE(from_message(message, rules, back));
    CHECK(back.disposition == record.disposition);
    CHECK(back.rule == record.rule);
    CHECK(back.actions == record.actions);
    CHECK(back.acted(rules[record.rule].action));
    CHECK(back.step == record.step);
    CHECK(back.rx_index == record.rx_index);
    CHECK(back.tx_index == record.tx_index);
    CHECK(back.draw_index == record.draw_index);
    CHECK(back.draw == record.draw);
    CHECK(back.direction == record.direction);
    CHECK(back.is_saturated == record.is_saturated);
    CHECK(message.attack_class == rules[record.rule].attack_class);
    CHECK(back.original.same_on_wire(record.original));
    CHECK(back.forwarded.same_on_wire(record.forwarded));
  }
  AttackRecord back;
  message.rule = "nobody";
  CHECK_FALSE(from_message(message, rules, back));
  message.rule = "cut";
  message.disposition = AttackRecord::kNumDispositions;
  CHECK_FALSE(from_message(message, rules, back));
  message.disposition = attack_frame_t::DUPLICATED;
  message.direction = 2;
  CHECK_FALSE(from_message(message, rules, back));
}
