#include "attacker/attack_rule.h"

#include "tests/support/catch.h"
#include "tests/unit/attacker/proxy_bench.h"

using namespace holdfast;
using namespace holdfast::test;

namespace {

bool says(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

}  // namespace

TEST_CASE("a scenario without attacks has no rules") {
  CHECK(rules_of("attacks: []").empty());
}

TEST_CASE("a rule is read with its defaults, and the resolved document states them") {
  ConfigurationDocument document = ConfigurationDocument::from_text(
      "attacks:\n  - {name: lie, match: {messages: [Flag1, Flag2]}, action: flip, signal: "
      "DETECT}\n",
      "t");
  const std::vector<AttackRule> rules = read_attack_rules(document.root(), test_layout());
  document.finish();
  REQUIRE(rules.size() == 1);
  const AttackRule& rule = rules[0];
  CHECK(rule.name == "lie");
  CHECK(rule.action == AttackRule::Action::kFlip);
  CHECK(rule.probability == 1.0);
  CHECK(rule.draw == AttackRule::Draw::kFrame);
  CHECK(rule.window.first_step == 1);
  CHECK(rule.window.last_step == StepWindow::kLastStep);
  CHECK(rule.match.matches_identifier(0x101, false));
  CHECK_FALSE(rule.match.matches_identifier(0x103, false));
  CHECK_FALSE(rule.match.matches_identifier(0x101, true));

  // What was resolved must read back to the same resolved text.
  const std::string resolved = document.resolved_text();
  for (const char* key :
       {"first_step: 1", "last_step: 4294967295", "to_s: .inf", "probability: 1", "draw: frame"}) {
    INFO(resolved);
    CHECK(says(resolved, key));
  }
  ConfigurationDocument again = ConfigurationDocument::from_text(resolved, "t");
  read_attack_rules(again.root(), test_layout());
  again.finish();
  CHECK(again.resolved_text() == resolved);
}

TEST_CASE("a rule may name the nodes whose messages it acts on") {
  const AttackRule by_node =
      rules_of("attacks: [{name: n, match: {nodes: [Other]}, action: drop}]")[0];
  CHECK(by_node.match.matches_identifier(259, false));
  CHECK(by_node.match.matches_identifier(288, false));
  CHECK_FALSE(by_node.match.matches_identifier(257, false));

  const AttackRule narrowed = rules_of(
      "attacks: [{name: n, match: {nodes: [Other], messages: [Flag1, Flag3]}, action: drop}]")[0];
  CHECK(narrowed.match.matches_identifier(259, false));
  CHECK_FALSE(narrowed.match.matches_identifier(288, false));
  CHECK_FALSE(narrowed.match.matches_identifier(257, false));

  CHECK(says(problems_of("attacks: [{name: n, match: {nodes: [Nobody]}, action: drop}]"),
             "sent by 'Nobody'"));
  CHECK(says(
      problems_of("attacks: [{name: n, match: {nodes: [Other], messages: [Flag1]}, action: drop}]"),
      "none of the messages"));
}

TEST_CASE("every key of an injection and of a comparison is read") {
  const AttackRule inject = rules_of(R"(
attacks:
  - name: ghosts
    match: {messages: [Level]}
    window: {first_step: 5, last_step: 9, from_s: 0.5, to_s: 0.9}
    probability: 0.25
    draw: step
    action: inject
    signal: LEVEL
    value: {distribution: normal, mean: 2, std: 3}
    count: {distribution: poisson, mean: 1.5}
    counter_offset: -2
)")[0];
  CHECK(inject.window.first_step == 5);
  CHECK(inject.window.last_step == 9);
  CHECK(inject.draw == AttackRule::Draw::kStep);
  CHECK(inject.values[0].kind == ValueDistribution::Kind::kNormal);
  CHECK(inject.values[0].mean == 2.0);
  CHECK(inject.values[0].std == 3.0);
  CHECK(inject.count.kind == CountDistribution::Kind::kPoisson);
  CHECK(inject.count.mean == 1.5);
  CHECK(inject.counter_signal == "STEP");
  CHECK(inject.counter_offset == -2);

  const AttackRule drop = rules_of(R"(
attacks:
  - {name: d, match: {identifier: 0x18FF0000, mask: 0x1FFF0000, extended: true}, action: drop}
)")[0];
  CHECK(drop.match.matches_identifier(0x18FF1234, true));
  CHECK_FALSE(drop.match.matches_identifier(0x18FE1234, true));
  CHECK_FALSE(drop.match.matches_identifier(0x100, false));
}

TEST_CASE("all problems of the rules are told at once, each with its line") {
  const std::string text = problems_of(R"(attacks:
  - name: one
    match: {messages: [Nobody]}
    action: drop
  - name: one
    match: {messages: [StepTick]}
    action: drop
  - name: three
    match: {messages: [Flag1, Level]}
    action: substitute
    signal: LEVEL
    value: {distribution: uniform, low: 2, high: 1}
  - name: four
    action: flip
  - name: five
    match: {messages: [Flag1]}
    action: flip
    bit: 24
  - name: six
    match: {messages: [Flag1], signal: DETECT}
    probability: 1.5
    window: {first_step: 9, last_step: 3}
    action: explode
  - name: seven
    match: {identifier: 0x7F0}
    action: inject
    count: {distribution: constant, mean: 1.5}
    colour: red
  - name: eight
    match: {mask: 0x700}
    action: drop
)");
  INFO(text);
  const char* const expected[] = {
      "test.yaml:3:23: attacks[0].match.messages: the DBC file has no message 'Nobody'",
      "test.yaml:5:11: attacks[1].name: 'one' given twice",
      "test.yaml:6:23: attacks[1].match.messages: no rule can match the tick ('StepTick')",
      "test.yaml:11:13: attacks[2].signal: message 'Flag1' has no signal 'LEVEL'",
      "test.yaml:12:50: attacks[2].value.high: lies below low",
      "test.yaml:14:13: attacks[3].action: flip needs either signal or bit",
      "test.yaml:18:10: attacks[4].bit: message 'Flag1' has 24 bits only",
      "test.yaml:20:40: attacks[5].match.signal: needs at_least, at_most, or both",
      "test.yaml:21:18: attacks[5].probability: 1.5 must be in [0, 1]",
      "test.yaml:22:40: attacks[5].window.last_step: lies before first_step",
      "test.yaml:23:13: attacks[5].action: 'explode' is none of: drop, flip, substitute, inject, "
      "force, add, scale, arm, bits, freeze, duplicate",
      "test.yaml:25:25: attacks[6].match.identifier: no rule can match the tick ('StepTick')",
      "attacks[6].signal: missing",
      "attacks[6].value: missing",
      "attacks[6].count.mean: a constant count must be a whole number",
      "attacks[6].match: an injection needs a message of the DBC file to forge",
      "attacks[6].colour: unknown key",
      "test.yaml:30:19: attacks[7].match.mask: needs the key identifier",
  };
  for (const char* problem : expected) CHECK(says(text, problem));
  CHECK_FALSE(says(text, "attacks[7].match.mask: unknown key"));
}

TEST_CASE("a signal must be in every message that was named, and in one of those under a mask") {
  CHECK(problems_of("attacks: [{name: a, match: {identifier: 0x100, mask: 0x7C0}, action: flip, "
                    "signal: DETECT}]") == "");
  CHECK(says(problems_of("attacks: [{name: a, match: {identifier: 0x100, mask: 0x7C0}, action: "
                         "flip, signal: STATE}]"),
             "no message that the rule matches has a signal 'STATE'"));
  CHECK(says(
      problems_of(
          "attacks: [{name: a, match: {messages: [Flag1, Mux]}, action: flip, signal: DETECT}]"),
      "message 'Mux' has no signal 'DETECT'"));
}

TEST_CASE("signals of a rule that no frame carries together are a problem") {
  const auto problem = [](const std::string& messages, const std::string& signals) {
    return problems_of("attacks: [{name: a, match: {messages: [" + messages +
                       "]}, action: freeze, signals: [" + signals + "]}]");
  };
  CHECK(problem("Nested", "DEEP, DEEPER, PART") == "");
  CHECK(says(problem("Nested", "TOP, DEEP"), "no frame of message 'Nested' carries all of them"));
  CHECK(says(problem("Mux", "A, B"), "no frame of message 'Mux' carries all of them"));
}

TEST_CASE("what is compared and what is written, or the counter, must stand in one frame") {
  FrameLayout layout = test_layout();
  layout.dbc.messages.push_back(parse_dbc("BO_ 5 Paged: 4 A\n"
                                          " SG_ PAGE M : 0|4@1+ (1,0) [0|0] \"\" B\n"
                                          " SG_ STEP m0 : 8|16@1+ (1,0) [0|0] \"\" B\n"
                                          " SG_ HIGH m1 : 8|8@1+ (1,0) [0|0] \"\" B\n"
                                          " SG_ NEVER m20 : 8|8@1+ (1,0) [0|0] \"\" B\n")
                                    .messages.at(0));
  const auto problem = [&](const std::string& match, const std::string& rest) {
    return problems_of(
        "attacks: [{name: a, match: {messages: [" + match + "}, action: " + rest + "}]", layout);
  };
  const std::string nested = "no frame of message 'Nested' carries all of them";
  const std::string top = "Nested], signal: TOP, at_least: 1";
  CHECK(problem("Nested], signal: PART, at_least: 1", "flip, signal: DEEP") == "");
  CHECK(says(problem(top, "flip, signal: DEEP"), "attacks[0].signal: " + nested));
  CHECK(says(problem(top, "freeze, signal: DEEP"), "attacks[0].signal: " + nested));
  CHECK(says(problem(top, "substitute, signals: [PAGE, DEEP], value: {value: 1}"),
             "attacks[0].signals: " + nested));
  CHECK(says(problem("Paged], signal: NEVER, at_least: 1", "drop"),
             "attacks[0].match.signal: no frame of message 'Paged' carries 'NEVER'"));
  CHECK(says(problem("Paged]", "flip, signal: NEVER"), "carries 'NEVER'"));

  // The network's counter, one of the rule's own, and none.
  const std::string high = "signal: HIGH, value: {value: 1}";
  const std::string counter = ": no frame of message 'Paged' carries the counter 'STEP'";
  CHECK(says(problem("Paged]", "inject, " + high), "attacks[0].signal" + counter));
  CHECK(says(problem("Paged]", "inject, counter_signal: STEP, " + high),
             "attacks[0].counter_signal" + counter));
  CHECK(problem("Paged]", "inject, counter_signal: PAGE, " + high) == "");
  CHECK(problem("Paged]", "inject, counter_signal: \"\", " + high) == "");
  CHECK(problem("Paged]", "inject, signal: PAGE, value: {value: 0}") == "");
  CHECK(says(problem("Paged]", "inject, signal: PAGE, value: {value: 1}"),
             "attacks[0].signal" + counter));
  // A masquerade repeats what it heard: the network's counter may be in some of its frames only.
  CHECK(problem("Paged]", "masquerade, " + high) == "");
  CHECK(says(problem("Paged]", "masquerade, counter_signal: STEP, " + high),
             "attacks[0].counter_signal: no frame of message 'Paged' carries all of them"));
}

TEST_CASE("a forgery may not write a selector so that its other signals are not there") {
  const auto problem = [](const std::string& action, const std::string& value) {
    return problems_of("attacks: [{name: a, match: {messages: [Nested]}, action: " + action +
                       ", value: {" + value + "}}]");
  };
  const std::string wrong =
      "attacks[0].value: no frame of message 'Nested' carries all signals when its selectors have "
      "these values";
  CHECK(problem("inject, signals: [PAGE, PART, DEEP]", "value: [1, 3, 9]") == "");
  CHECK(problem("inject, signals: [PAGE]", "value: 5") == "");
  CHECK(says(problem("inject, signals: [PAGE, DEEP]", "value: [0, 9]"), wrong));
  CHECK(says(problem("inject, signals: [DEEP, PART]", "value: [9, 4]"), wrong));
  CHECK(says(problem("masquerade, signals: [PAGE, DEEP]", "value: [0, 9]"), wrong));
  // What is drawn is known in each frame only.
  CHECK(problem("inject, signals: [PAGE, DEEP]", "distribution: uniform, low: 0, high: 2") == "");
}

TEST_CASE("a window counts both ends, in steps and in seconds, whatever the binary rounding") {
  StepWindow window;
  window.from_s = 0.3;
  window.to_s = 0.7;
  for (int step = 1; step <= 10; ++step) {
    INFO(step);
    CHECK(window.contains(step, 0.1) == (step >= 3 && step <= 7));
  }
  window.first_step = 5;
  window.last_step = 6;
  for (int step = 1; step <= 10; ++step)
    CHECK(window.contains(step, 0.1) == (step == 5 || step == 6));
}
