// Commands on their way back to the plant: genuine ones that pass, and forged ones.
#include <set>

#include "drivers/can/command_codec.h"
#include "tests/support/catch.h"
#include "tests/support/texts.h"
#include "tests/unit/attacker/proxy_bench.h"

using namespace holdfast;
using namespace holdfast::test;

namespace {

FrameLayout breaker_layout() {
  FrameLayout layout = test_layout();
  const Dbc more = parse_dbc(
      "BO_ 64 Breaker: 5 Node\n SG_ MODE : 0|8@1+ (1,0) [0|0] \"\" N\n SG_ STEP : 8|32@1+ (1,0) "
      "[0|0] \"\" N\n");
  layout.dbc.messages.push_back(more.messages.front());
  layout.command.message = "Breaker";
  layout.command.mode_names = {"closed", "half", "open"};
  return layout;
}

std::vector<AttackRule> breaker_rules(const std::string& list) {
  return rules_of("attacks: [" + list + "]", breaker_layout());
}

std::string breaker_problems(const std::string& list) {
  return problems_of("attacks: [" + list + "]", breaker_layout());
}

class Bench {
 public:
  explicit Bench(const std::string& list, std::uint64_t seed = 1)
      : codec_(breaker_layout()), core_(breaker_rules(list), breaker_layout(), seed, 0, 0.5) {}

  void step(double level = 0.0) {
    core_.on_frame(reading("Level", core_.current_step(), "LEVEL", level), out_);
    core_.on_frame(tick(core_.current_step()), out_);
  }
  void steps(int count) {
    for (int i = 0; i < count; ++i) step();
  }
  void answer(const CanFrame& frame) { core_.on_monitor_frame(frame, out_); }
  void order(int mode, std::int64_t from_step) { answer(codec_.encode({from_step, mode})); }
  std::vector<std::pair<std::int64_t, int>> commands() const {
    std::vector<std::pair<std::int64_t, int>> list;
    for (const CanFrame& frame : out_.commands) {
      const auto command = codec_.decode(frame);
      REQUIRE(command.has_value());
      list.emplace_back(command->from_step, command->mode);
    }
    return list;
  }
  const ProxyCore& core() const { return core_; }
  const ProxyOutput& out() const { return out_; }

 private:
  CommandCodec codec_;
  ProxyCore core_;
  ProxyOutput out_;
};

using Commands = std::vector<std::pair<std::int64_t, int>>;

const std::string kBreaker = "match: {messages: [Breaker]}, ";

}  // namespace

TEST_CASE("a command without rules reaches the plant as it is, and nothing else comes back") {
  Bench bench("");
  bench.order(2, 40);
  bench.answer(reading("Level", 1, "LEVEL", 3.0));
  bench.answer(tick(1));
  CHECK(bench.commands() == Commands{{40, 2}});
  CHECK(bench.out().frames.empty());
  CHECK(bench.out().command_records.empty());
  CHECK(bench.core().current_step() == 1);
  CHECK(bench.core().command_counters().received == 1);
  CHECK(bench.core().command_counters().passed == 1);
  CHECK(bench.core().counters().received == 0);
}

TEST_CASE("a forged command: when its window says, for a step that lies ahead") {
  Bench bench("{name: r, " + kBreaker +
              "action: inject, mode: open, window: {first_step: 3, last_step: 4}, lead_steps: 7}");
  bench.steps(6);
  CHECK(bench.commands() == Commands{{10, 2}, {11, 2}});
  REQUIRE(bench.out().command_records.size() == 2);
  const AttackRecord& record = bench.out().command_records.front();
  CHECK(record.direction == AttackRecord::Direction::kToPlant);
  CHECK(record.disposition == AttackRecord::Disposition::kInjected);
  CHECK(record.step == 3);
  CHECK(record.tx_index == 0);
  CHECK(record.forwarded.same_on_wire(bench.out().commands.front()));
  // The monitor's side does not notice: no forged frame, no record, numbers of its own.
  CHECK(bench.out().frames.size() == 12);
  CHECK(bench.out().records.empty());
  CHECK(bench.core().counters().injected == 0);
  CHECK(bench.core().command_counters().injected == 2);

  Bench by_time("{name: r, " + kBreaker +
                "action: inject, mode: half, window: {from_s: 1, to_s: 1}}");
  by_time.steps(6);
  CHECK(by_time.commands() == Commands{{22, 1}});  // 0.5 s a step; 20 steps ahead by default
}

TEST_CASE("a command that is forged too late says so, and does not wrap") {
  Bench bench("{name: r, " + kBreaker +
              "action: inject, mode: open, window: {first_step: 2, last_step: 3}, lead_steps: -3}");
  bench.steps(4);
  CHECK(bench.commands() == Commands{{0, 2}, {0, 2}});
}

TEST_CASE("an injection that forges nothing has not acted") {
  Bench bench("{name: r, " + kBreaker +
              "action: inject, mode: open, times: 5, count: {distribution: poisson, mean: 0.1}}");
  bench.steps(400);
  std::set<std::int64_t> steps;
  for (const AttackRecord& record : bench.out().command_records) steps.insert(record.step);
  CHECK(steps.size() == 5);
  CHECK(*steps.rbegin() > 5);
}

TEST_CASE("a forged command when the plant's state is seen to be high, once") {
  const std::string arm =
      "{name: high, match: {messages: [Level], signal: LEVEL, at_least: 2}, action: arm}, ";
  const std::string inject =
      "{name: r, " + kBreaker + "action: inject, given: high, mode: open, lead_steps: 5";
  Bench once(arm + inject + ", times: 1}"), always(arm + inject + "}"),
      unless(arm + "{name: r, " + kBreaker +
             "action: inject, unless: high, mode: open, lead_steps: 5}");
  for (const double level : {0.0, 1.9, 2.5, 3.0, 0.0, 2.0}) {
    for (Bench* bench : {&once, &always, &unless}) bench->step(level);
  }
  CHECK(once.commands() == Commands{{8, 2}});
  CHECK(always.commands() == Commands{{8, 2}, {9, 2}, {11, 2}});
  CHECK(unless.commands() == Commands{{6, 2}, {7, 2}, {10, 2}});
}

TEST_CASE("rules drop and alter genuine commands by the step at which they are to act") {
  const std::string rules =
      "{name: hide, " + kBreaker +
      "action: drop, window: {first_step: 30, last_step: 39}}, {name: swap, " + kBreaker +
      "action: substitute, mode: half, window: {first_step: 40}}, " + "{name: late, " + kBreaker +
      "action: add, signal: STEP, value: {value: 100}, window: {first_step: 50}}";
  Bench bench(rules);
  bench.order(2, 20);
  bench.order(2, 30);
  bench.steps(3);
  bench.order(2, 40);
  bench.order(2, 50);
  CHECK(bench.commands() == Commands{{20, 2}, {40, 1}, {150, 1}});
  const std::vector<AttackRecord>& records = bench.out().command_records;
  REQUIRE(records.size() == 3);
  CHECK(records[0].disposition == AttackRecord::Disposition::kDropped);
  CHECK(records[0].step == 30);
  CHECK(records[1].step == 40);
  CHECK(records[1].rx_index == 2);
  CHECK(records[1].tx_index == 1);
  CHECK(records[2].actions == (1U << 2 | 1U << 5));
  const ProxyCounters& c = bench.core().command_counters();
  CHECK(c.received == c.passed + c.altered + c.dropped);
  CHECK(c.sent == c.passed + c.altered + c.injected);
  CHECK(c.sent == 3);
}

TEST_CASE("what is drawn for a command does not depend on when it comes by") {
  const std::string rule = "{name: r, " + kBreaker + "action: drop, probability: 0.5}";
  std::set<std::int64_t> early_set, late_set, other_set;
  Bench early(rule), late(rule), other(rule, 2);
  for (int i = 0; i < 200; ++i) {
    early.order(1, 500 + i);
    late.step();
    late.order(1, 500 + i);
    other.order(1, 500 + i);
  }
  CHECK(early.commands() == late.commands());
  CHECK(early.commands() != other.commands());  // negative control: another seed draws otherwise
  CHECK(early.commands().size() > 60);
  CHECK(early.commands().size() < 140);
}

TEST_CASE("rules that do not name the command leave it alone, both ways") {
  Bench bench("{name: all, action: drop}, {name: by_mask, match: {identifier: 64}, action: drop}");
  bench.order(1, 9);
  bench.steps(2);
  CHECK(bench.commands() == Commands{{9, 1}});
  CHECK(bench.core().counters().dropped == 2);  // the two readings
}

TEST_CASE("a malformed command is for the plant to refuse") {
  Bench bench("{name: r, " + kBreaker + "action: drop}");
  CanFrame frame = CommandCodec(breaker_layout()).encode({10, 1});
  frame.num_bytes = 2;
  bench.answer(frame);
  REQUIRE(bench.out().commands.size() == 1);
  CHECK(bench.out().commands.front().same_on_wire(frame));
  CHECK_FALSE(CommandCodec(breaker_layout()).decode(frame).has_value());
}

TEST_CASE("rules for commands that can do nothing are refused, with a reason") {
  const auto says = [](const std::string& rest, const std::string& text) {
    testing::check_mentions(breaker_problems("{name: r, " + rest + "}"), text);
  };
  says(kBreaker + "action: inject, mode: ajar",
       "mode: 'ajar' is none of the plant's modes: closed, half, open");
  says(kBreaker + "action: inject, mode: open, value: {value: 1}",
       "value: is the command's mode already");
  says("match: {messages: [Breaker, Level]}, action: drop", "a rule for each way");
  says(kBreaker + "action: add, signal: MODE, value: {distribution: random_walk, std: 1}",
       "commands are no readings");
  says(kBreaker + "action: drop, times: 0", "times");
  says("match: {messages: [Level]}, action: inject, mode: open", "mode: unknown key");
  CHECK(breaker_problems("{name: a, match: {messages: [Level]}, action: arm}, {name: r, " +
                         kBreaker + "action: drop, given: a}")
            .find("acts on frames that go the other way") != std::string::npos);
  says(
      kBreaker + "action: inject, signal: MODE, value: {distribution: replay, delay_steps: [1, 2]}",
      "commands are no readings");
  for (const std::string action : {"add", "scale"})
    says(kBreaker + "action: " + action + ", mode: open", "mode: unknown key");
  CHECK(breaker_problems("{name: a, " + kBreaker + "action: drop}, {name: r, " + kBreaker +
                         "action: inject, mode: open, given: a}")
            .find("in which step they come by is chance") != std::string::npos);
  says(kBreaker + "action: inject, signals: [MODE, STEP], value: {value: [1, 30]}",
       "'STEP' is what lead_steps says");
  says(kBreaker + "action: inject, signal: STEP, value: {value: 30}", "needs its mode");
  says("match: {messages: [Breaker], identifier: 0x100}, action: drop",
       "is that of none of the messages");
  CHECK(breaker_problems("{name: r, " + kBreaker + "action: inject, mode: open}") == "");
}
