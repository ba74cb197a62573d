// Rules that force, add to and scale what a frame carries, and draws that signals share.
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>

#include "common/random_stream.h"
#include "tests/support/catch.h"
#include "tests/support/texts.h"
#include "tests/unit/attacker/proxy_bench.h"

using namespace holdfast;
using namespace holdfast::test;

namespace {

CanFrame pair(double left, double right) {
  CanFrame frame = reading("Pair", 1, "LEFT", left);
  const FrameLayout layout = test_layout();
  layout.dbc.find("Pair")->find("RIGHT")->pack({frame.data.data(), frame.num_bytes}, right);
  return frame;
}

// What the rule sends for a frame with this LEFT, and an equal RIGHT that no rule may touch.
double sent_for(const std::string& rest, double left) {
  const CanFrame frame = pair(left, 5.0);
  const Outcome outcome = run_proxy(rules_of(pair_rule(rest)), {frame});
  REQUIRE(outcome.records.size() == 1);
  CHECK(outcome.records[0].disposition == AttackRecord::Disposition::kAltered);
  CHECK(outcome.records[0].original.same_on_wire(frame));
  CHECK(outcome.records[0].forwarded.same_on_wire(outcome.sent.at(0)));
  CHECK(outcome.counters.altered == 1);
  CHECK(value_of(outcome.sent[0], "RIGHT") == 5.0);
  CHECK(value_of(outcome.sent[0], "STEP") == 1.0);
  return value_of(outcome.sent[0], "LEFT");
}

// Drawn numbers: what rules that write, add to or scale put into two Pair frames of each step.
std::vector<std::array<double, 4>> written(const std::string& rest, int num_steps) {
  std::vector<std::array<double, 4>> values;
  const Outcome outcome =
      run_proxy(rules_of(pair_rule(rest)), steps_of(num_steps, [](int) -> std::vector<CanFrame> {
                  return {pair(1, 1), pair(1, 1)};
                }));
  for (std::size_t i = 0; i + 1 < outcome.records.size(); i += 2) {
    const CanFrame& a = outcome.records[i].forwarded;
    const CanFrame& b = outcome.records[i + 1].forwarded;
    values.push_back(
        {value_of(a, "LEFT"), value_of(a, "RIGHT"), value_of(b, "LEFT"), value_of(b, "RIGHT")});
  }
  return values;
}

DbcSignal random_signal(const RandomStream& stream, std::uint32_t i) {
  static constexpr DbcSignal::Kind kKinds[] = {DbcSignal::Kind::kUnsigned, DbcSignal::Kind::kSigned,
                                               DbcSignal::Kind::kFloat32};
  const auto below = [&](std::uint64_t draw, int bound) {
    return static_cast<int>(stream.uniform(i, draw) * bound);
  };
  DbcSignal signal;
  signal.kind = kKinds[below(0, 3)];
  signal.num_bits = signal.kind == DbcSignal::Kind::kFloat32 ? 32 : 4 + below(1, 29);
  signal.scale = (below(2, 2) == 0 ? 1.0 : -1.0) * std::pow(10.0, -below(3, 4)) * (1 + below(4, 9));
  signal.offset = below(5, 2) == 0 ? 0.0 : signal.scale * (below(6, 41) - 20);
  return signal;
}

}  // namespace

TEST_CASE("force writes zero when nothing else is asked for") {
  CHECK(sent_for("action: force, signal: LEFT", 7.5) == 0.0);
  CHECK(sent_for("action: force, signals: [LEFT], value: {value: 3}", 7.5) == 3.0);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(sent_for("action: force, signal: LEFT", nan) == 0.0);

  // The default stands in the resolved document, which reads back as the same rule.
  ConfigurationDocument document =
      ConfigurationDocument::from_text(pair_rule("action: force, signals: [LEFT, RIGHT]"), "t");
  read_attack_rules(document.root(), test_layout());
  document.finish();
  const std::string resolved = document.resolved_text();
  INFO(resolved);
  CHECK(resolved.find("value: [0, 0]") != std::string::npos);
  const AttackRule again = rules_of(resolved)[0];
  CHECK(again.action == AttackRule::Action::kForce);
  CHECK(again.values.size() == 2);
}

TEST_CASE("what is forced to zero decodes to zero wherever the signal can say zero") {
  const RandomStream stream(1, 0, "signals");
  int num_exact = 0, num_never = 0;
  for (std::uint32_t i = 0; i < 20000; ++i) {
    DbcSignal signal = random_signal(stream, i);
    CanFrame frame;
    frame.num_bytes = 8;
    const std::span<std::uint8_t> data(frame.data.data(), 8);
    signal.set_raw(data, 1);
    signal.pack(data, 0.0);
    const double forced = signal.unpack(frame.bytes());
    // Were there a way to say zero, it would lie within a few steps of the nearest raw value.
    const std::uint64_t raw = signal.raw(frame.bytes());
    bool can_say_zero = false;
    for (std::uint64_t delta = 0; delta < 7; ++delta) {
      signal.set_raw(data, raw + delta - 3);
      can_say_zero |= signal.unpack(frame.bytes()) == 0.0;
    }
    if (can_say_zero) {
      REQUIRE(forced == 0.0);
      ++num_exact;
    } else {
      ++num_never;
    }
  }
  CHECK(num_exact > 1000);
  CHECK(num_never > 100);
}

TEST_CASE("add and scale start from what the frame carries, the signal's range holds the result") {
  for (const double left : {-3.5, 0.0, 0.25, 1e6}) {
    CHECK(sent_for("action: add, signal: LEFT, value: {value: 2.5}", left) == left + 2.5);
    CHECK(sent_for("action: scale, signal: LEFT, value: {value: -0.5}", left) == left * -0.5);
  }
  // An unsigned 16-bit counter saturates at both ends and rounds to whole numbers.
  const auto counter = [](const std::string& rest) {
    const Outcome outcome = run_proxy(rules_of(pair_rule(rest)), {reading("Pair", 1000, "", 0.0)});
    return value_of(outcome.sent.at(0), "STEP");
  };
  CHECK(counter("action: add, signal: STEP, value: {value: 1.4}") == 1001.0);
  CHECK(counter("action: add, signal: STEP, value: {value: -2000}") == 0.0);
  CHECK(counter("action: add, signal: STEP, value: {value: 1e9}") == 65535.0);
  CHECK(counter("action: scale, signal: STEP, value: {value: 1.0005}") == 1001.0);
  CHECK(counter("action: scale, signal: STEP, value: {value: -1}") == 0.0);
  CHECK(counter("action: scale, signal: STEP, value: {value: 1e300}") == 65535.0);
}

TEST_CASE("a number that is not finite stays so, whatever is added or multiplied") {
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double left : {infinity, -infinity, std::numeric_limits<double>::quiet_NaN()}) {
    for (const char* value : {"0", "-1", "2", "1e300", "-1e300"}) {
      for (const char* action : {"add", "scale"}) {
        INFO(action << ' ' << value << " of " << left);
        CHECK_FALSE(std::isfinite(sent_for(
            "action: " + std::string(action) + ", signal: LEFT, value: {value: " + value + "}",
            left)));
      }
    }
  }
  // A finite one stays finite: it ends at the largest float.
  CHECK(sent_for("action: scale, signal: LEFT, value: {value: 1e300}", -1.0) ==
        -static_cast<double>(std::numeric_limits<float>::max()));
}

TEST_CASE("rules that change a frame act in their order, each on what is left") {
  const Outcome outcome = run_proxy(rules_of(R"(
attacks:
  - {name: b, match: {messages: [Pair]}, action: add, signal: LEFT, value: {value: 3}}
  - {name: s, match: {messages: [Pair]}, action: scale, signals: [LEFT, RIGHT], value: {value: [2, 10]}}
  - {name: c, match: {messages: [Pair]}, action: add, signal: RIGHT, value: {value: 1}}
)"),
                                    {pair(4, 5)});
  REQUIRE(outcome.records.size() == 1);
  CHECK(outcome.records[0].rule == 0);
  CHECK(value_of(outcome.sent[0], "LEFT") == 14.0);
  CHECK(value_of(outcome.sent[0], "RIGHT") == 51.0);
}

TEST_CASE("draws of signals stay where they always were, and shared ones are the first signal's") {
  // The address is (key << 34) + (index << 8) + (purpose << 1): purpose 1 for the first signal,
  // 16 + n for the nth after it, 6 without key and index for a draw of the step.
  const RandomStream stream(1, 0, "attack/r");
  const auto z = [&](std::size_t step, std::uint64_t index, unsigned purpose) {
    return stream.normal(static_cast<std::uint32_t>(step),
                         (std::uint64_t{0x140} << 34) + (index << 8) + (purpose << 1));
  };
  const auto same = [](double written, double mean, double std, double normal) {
    return written == static_cast<double>(static_cast<float>(mean + std * normal));
  };
  const std::string value =
      "action: substitute, signals: [LEFT, RIGHT], value: {distribution: normal, mean: [1, -2], "
      "std: [0.5, 3]";
  const auto by_signal = written(value + "}", 50), said = written(value + ", draw: signal}", 50);
  const auto by_frame = written(value + ", draw: frame}", 50);
  const auto by_step = written(value + ", draw: step}", 50);
  CHECK(by_signal == said);
  REQUIRE(by_step.size() == 50);
  for (std::size_t k = 0; k < 50; ++k) {
    for (std::uint64_t index = 0; index < 2; ++index) {
      const std::size_t left = 2 * index, right = left + 1;
      CHECK(same(by_signal[k][left], 1, 0.5, z(k + 1, index, 1)));
      CHECK(same(by_signal[k][right], -2, 3, z(k + 1, index, 17)));
      CHECK(same(by_frame[k][left], 1, 0.5, z(k + 1, index, 1)));
      CHECK(same(by_frame[k][right], -2, 3, z(k + 1, index, 1)));
      const double of_step = stream.normal(static_cast<std::uint32_t>(k + 1), 6 << 1);
      CHECK(same(by_step[k][left], 1, 0.5, of_step));
      CHECK(same(by_step[k][right], -2, 3, of_step));
    }
  }
}

TEST_CASE("a draw is shared by exactly what it says, whatever the action and the distribution") {
  for (const char* action : {"substitute", "force", "add", "scale"}) {
    for (const char* distribution : {"uniform, low: 2, high: 3", "normal, mean: 0, std: 1"}) {
      std::array<std::set<double>, 3> seen;
      const char* const draws[] = {"signal", "frame", "step"};
      for (std::size_t d = 0; d < 3; ++d) {
        for (const auto& v : written("action: " + std::string(action) +
                                         ", signals: [LEFT, RIGHT], value: {distribution: " +
                                         distribution + ", draw: " + draws[d] + "}",
                                     40)) {
          seen[d].insert(v.begin(), v.end());
        }
      }
      INFO(action << ' ' << distribution);
      // 4 values per step, 2 frames per step, 1 step; floats of 160 draws do not collide.
      CHECK(seen[0].size() == 160);
      CHECK(seen[1].size() == 80);
      CHECK(seen[2].size() == 40);
    }
  }
}

TEST_CASE("a draw of the step is shared by messages and by forged frames") {
  const Outcome outcome = run_proxy(
      rules_of("attacks: [{name: w, match: {messages: [Flag1, Flag2]}, action: substitute, signal: "
               "STEP, value: {distribution: uniform, low: 0, high: 65535, draw: step}}, {name: i, "
               "match: {messages: [Pair]}, action: inject, signals: [LEFT, RIGHT], count: {mean: "
               "3}, value: {distribution: bernoulli, probability: [0.5, 0.9], draw: step}}]"),
      steps_of(200, [](int step) -> std::vector<CanFrame> {
        return {reading("Flag1", step, "DETECT", 1), reading("Flag2", step, "DETECT", 1)};
      }));
  REQUIRE(outcome.records.size() == 200 * 5);
  int ones = 0;
  for (std::size_t i = 0; i < outcome.records.size(); i += 5) {
    const AttackRecord* const r = &outcome.records[i];
    CHECK(value_of(r[0].forwarded, "STEP") == value_of(r[1].forwarded, "STEP"));
    for (std::size_t forged = 2; forged < 5; ++forged) {
      const double left = value_of(r[forged].forwarded, "LEFT");
      CHECK(left == value_of(r[2].forwarded, "LEFT"));
      // One uniform number under two thresholds: the likelier bit is set whenever the other is.
      CHECK(left <= value_of(r[forged].forwarded, "RIGHT"));
      ones += forged == 2 && left == 1.0;
    }
  }
  CHECK(std::abs(ones - 100) < 4.5 * std::sqrt(200 * 0.25));
}

TEST_CASE("values that an action cannot use are told") {
  const auto says = [](const std::string& rest, const std::string& part) {
    testing::check_mentions(problems_of(pair_rule(rest)), part);
  };
  const std::string replay = "value: {distribution: replay, delay_steps: [1, 1]";
  says("action: add, signal: LEFT, " + replay + "}", "cannot be used by add; use substitute");
  says("action: scale, signal: LEFT, " + replay + "}", "cannot be used by scale; use substitute");
  says("action: force, signal: LEFT, " + replay + ", draw: frame}", "one delay for each frame");
  says("action: substitute, signal: LEFT, " + replay + ", draw: step}", "one delay for each frame");
  says("action: add, signal: LEFT, value: {value: 1, draw: run}", "none of: signal, frame, step");
  says("action: add, signal: LEFT", "value: missing");
  says("action: scale, signals: [LEFT], value: {distribution: constant}", "value.value: missing");
  says("action: force, value: {value: 1}", "signal: missing");
  CHECK(
      problems_of(pair_rule("action: force, signal: LEFT, " + replay + ", draw: signal}")).empty());
}
