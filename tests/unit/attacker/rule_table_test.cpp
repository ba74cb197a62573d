// What a table of rules holds of the messages, and where a forgery writes its counter.
#include "attacker/rule_table.h"

#include <memory>
#include <string>
#include <vector>

#include "tests/support/allocation_count.h"
#include "tests/support/catch.h"
#include "tests/unit/attacker/proxy_bench.h"

namespace holdfast::test {
namespace {

// PAGE selects: VALUE and, behind it, the counter, when 1; TEXT in their place when 2.
FrameLayout paged_layout() {
  FrameLayout layout = test_layout();
  layout.dbc.messages.push_back(parse_dbc("BO_ 5 Paged: 4 A\n"
                                          " SG_ PAGE M : 0|4@1+ (1,0) [0|0] \"\" B\n"
                                          " SG_ VALUE m1 : 8|8@1+ (1,0) [0|0] \"\" B\n"
                                          " SG_ STEP m1 : 16|16@1+ (1,0) [0|0] \"\" B\n"
                                          " SG_ TEXT m2 : 8|24@1+ (1,0) [0|0] \"\" B\n"
                                          " SG_ ALWAYS : 4|4@1+ (1,0) [0|0] \"\" B\n")
                                    .messages.at(0));
  return layout;
}

std::vector<CanFrame> sent_by(const std::string& yaml, const std::vector<CanFrame>& frames) {
  const FrameLayout layout = paged_layout();
  ProxyCore proxy(rules_of(yaml, layout), layout, 1, 0, 1.0);
  ProxyOutput out;
  for (const CanFrame& frame : frames) proxy.on_frame(frame, out);
  std::vector<CanFrame> sent;
  for (const CanFrame& frame : out.frames) {
    if (frame.identifier == 5) sent.push_back(frame);
  }
  return sent;
}

CanFrame paged(std::uint8_t page) {
  CanFrame frame = paged_layout().dbc.find("Paged")->empty_frame();
  frame.data = {page, 0x11, 0x22, 0x33};
  return frame;
}

// A message with as many signals as some vendors' have, all of whose names are long.
Dbc wide_messages(int num_messages) {
  std::string text;
  for (int message = 0; message < num_messages; ++message) {
    text += "BO_ " + std::to_string(256 + message) + " Wide" + std::to_string(message) + ": 8 A\n";
    for (int i = 0; i < 41; ++i)
      text += " SG_ a_signal_whose_name_is_long_" + std::to_string(i) + " : " + std::to_string(i) +
              "|1@1+ (1,0) [0|0] \"\" B\n";
    text += " SG_ of" + std::to_string(message) + " : 48|8@1+ (1,0) [0|0] \"\" B\n";
  }
  return parse_dbc(text);
}

// Allocations of a table of so many rules, which flip the signal wherever it is.
std::int64_t allocations(int num_rules, const std::string& signal) {
  FrameLayout layout = test_layout();
  layout.dbc = wide_messages(20);
  std::string yaml = "attacks:\n";
  for (int i = 0; i < num_rules; ++i)
    yaml += "  - {name: r" + std::to_string(i) +
            ", match: {identifier: 0, mask: 0}, action: flip, signal: " + signal + "}\n";
  const std::vector<AttackRule> rules = rules_of(yaml, layout);
  const std::int64_t before = testing::allocation_count();
  const RuleTable table(rules, layout);
  const std::int64_t count = testing::allocation_count() - before;
  CHECK(table.num_targets() == rules.size() * (signal == "of7" ? 1 : 20));
  return count;
}

}  // namespace

TEST_CASE("rules share one copy of a message, and have none of messages without their signals") {
  const std::string everywhere = "a_signal_whose_name_is_long_3";
  // Less than half of a copy for each rule and message.
  CHECK(allocations(41, everywhere) - allocations(1, everywhere) < 40 * 20 * 41 / 2);
  CHECK(allocations(1, "of7") < 41 + 60);
  CHECK(allocations(41, "of7") - allocations(1, "of7") < 40 * 41 / 2);

  const FrameLayout layout = test_layout();
  const RuleTable table(
      rules_of("attacks: [{name: a, match: {messages: [Pair]}, action: flip, signal: LEFT},"
               " {name: b, match: {messages: [Pair]}, action: flip, signal: RIGHT}]"),
      layout);
  const auto candidates = table.to_monitor(reading("Pair", 1, "", 0.0));
  REQUIRE(candidates.size() == 2);
  CHECK(table.target(candidates[0]).message == table.target(candidates[1]).message);
  CHECK(table.target(candidates[0]).message->name == "Pair");
}

TEST_CASE("an injection's selectors carry its counter, too") {
  const std::vector<CanFrame> sent = sent_by(
      "attacks: [{name: i, match: {messages: [Paged]}, action: inject, signal: ALWAYS, "
      "value: {value: 7}}]",
      {tick(1), tick(2)});
  REQUIRE(sent.size() == 2);
  for (std::uint8_t step = 1; step <= 2; ++step) {
    CHECK(sent[step - 1].data[0] == 0x71);
    CHECK(sent[step - 1].data[2] == step);
  }
}

TEST_CASE("a masquerade writes the counter only where the sender's frames have it") {
  const std::string rule =
      "attacks: [{name: m, match: {messages: [Paged]}, window: {first_step: 4}, action: "
      "masquerade}]";
  for (const std::uint8_t page : {std::uint8_t{1}, std::uint8_t{2}}) {
    const CanFrame heard = paged(page);
    const std::vector<CanFrame> sent = sent_by(
        rule, {heard, tick(1), heard, tick(2), heard, tick(3), heard, tick(4), heard, tick(5)});
    REQUIRE(sent.size() == 5);
    CHECK(sent[4].same_on_wire(heard) == (page == 2));
    CHECK(sent[4].data[1] == 0x11);
    if (page == 1) CHECK(sent[4].data[2] == 5);
  }
}

}  // namespace holdfast::test
