#include "attacker/proxy_core.h"

#include <cmath>
#include <tuple>

#include "tests/support/catch.h"
#include "tests/unit/attacker/proxy_bench.h"

using namespace holdfast;
using namespace holdfast::test;
using Disposition = AttackRecord::Disposition;

namespace {

std::vector<CanFrame> three_flags(int step) {
  return {reading("Flag1", step, "DETECT", 1), reading("Flag2", step, "DETECT", 0),
          reading("Flag3", step, "DETECT", 1)};
}

}  // namespace

TEST_CASE("without rules every frame leaves as it came, FD with 64 bytes included") {
  CanFrame fd;
  fd.identifier = 0x5;
  fd.flags = CanFrame::kFd | CanFrame::kBitRateSwitch;
  fd.num_bytes = 64;
  for (std::size_t i = 0; i < 64; ++i) fd.data[i] = static_cast<std::uint8_t>(3 * i + 1);
  CanFrame remote;
  remote.identifier = 0x101;
  remote.flags = CanFrame::kRemote;
  remote.num_bytes = 3;
  CanFrame extended = fd;
  extended.identifier = 0x1FFFFFFF;
  extended.flags = CanFrame::kExtended;
  extended.num_bytes = 8;
  CanFrame empty;
  const std::vector<CanFrame> frames = {
      fd, remote, extended, empty, reading("Flag1", 1, "DETECT", 1), tick(1), fd};
  // A rule about other frames must not change anything either.
  for (const char* yaml :
       {"attacks: []", "attacks: [{name: d, match: {messages: [Flag2]}, action: drop}]"}) {
    const Outcome outcome = run_proxy(rules_of(yaml), frames);
    CHECK(same_frames(outcome.sent, frames));
    CHECK(outcome.records.empty());
    CHECK(outcome.counters.passed == 7);
    CHECK(outcome.counters.received == 7);
    CHECK(outcome.counters.sent == 7);
  }
}

TEST_CASE("probability 0 is the same as no rule; probability 1 touches every frame") {
  const std::vector<CanFrame> frames = steps_of(50, three_flags);
  const std::string rule = "match: {messages: [Flag1, Flag3]}, action: flip, signal: DETECT";
  const Outcome never =
      run_proxy(rules_of("attacks: [{name: f, probability: 0, " + rule + "}]"), frames);
  CHECK(same_frames(never.sent, frames));
  CHECK(never.records.empty());
  const Outcome always =
      run_proxy(rules_of("attacks: [{name: f, probability: 1, " + rule + "}]"), frames);
  CHECK(always.records.size() == 100);
  CHECK(always.counters.altered == 100);
  for (const AttackRecord& record : always.records) {
    CHECK(value_of(record.original, "DETECT") == 1.0);
    CHECK(value_of(record.forwarded, "DETECT") == 0.0);
    CHECK(value_of(record.forwarded, "STEP") == static_cast<double>(record.step));
  }
}

TEST_CASE("a dropped frame leaves no trace on the bus, and the record tells both indices") {
  const Outcome outcome =
      run_proxy(rules_of("attacks: [{name: d, match: {messages: [Flag2]}, action: drop}]"),
                steps_of(2, three_flags));
  REQUIRE(outcome.sent.size() == 6);
  REQUIRE(outcome.records.size() == 2);
  CHECK(outcome.records[1].disposition == Disposition::kDropped);
  CHECK(outcome.records[1].rx_index == 5);
  CHECK(outcome.records[1].tx_index == -1);
  CHECK(outcome.records[1].step == 2);
  CHECK(outcome.records[1].original.same_on_wire(three_flags(2)[1]));
}

TEST_CASE("the record's tx_index is the place of the frame among those sent") {
  const Outcome outcome = run_proxy(rules_of(R"(
attacks:
  - {name: d, match: {messages: [Flag1]}, action: drop}
  - {name: f, match: {messages: [Flag3]}, action: flip, signal: DETECT}
  - {name: i, match: {messages: [Level]}, action: inject, signal: LEVEL, value: {value: 1}}
)"),
                                    steps_of(3, three_flags));
  int checked = 0;
  for (const AttackRecord& record : outcome.records) {
    if (record.tx_index < 0) continue;
    CHECK(
        record.forwarded.same_on_wire(outcome.sent.at(static_cast<std::size_t>(record.tx_index))));
    ++checked;
  }
  CHECK(checked == 6);
}

TEST_CASE("no rule touches the tick, whatever it matches, and odd ticks do not move the step") {
  const char* const everything[] = {
      "attacks: [{name: a, action: drop}]",
      "attacks: [{name: a, match: {identifier: 0, mask: 0}, action: drop}]",
      "attacks: [{name: a, match: {identifier: 0x700, mask: 0x700}, action: flip, bit: 0}]",
      "attacks: [{name: a, action: substitute, signal: STEP, value: {value: 7}}]",
  };
  CanFrame short_tick = tick(2);
  short_tick.num_bytes = 1;
  CanFrame long_tick = tick(2);
  long_tick.num_bytes = 3;
  CanFrame fd_tick = tick(2);
  fd_tick.flags = CanFrame::kFd;
  CanFrame remote_tick = tick(2);
  remote_tick.flags = CanFrame::kRemote;
  const std::vector<CanFrame> ticks = {tick(1),   tick(1), tick(7),     short_tick,
                                       long_tick, fd_tick, remote_tick, tick(2)};
  for (const char* yaml : everything) {
    ProxyCore proxy(rules_of(yaml), test_layout(), 1, 0, 1.0);
    ProxyOutput out;
    for (const CanFrame& frame : ticks) {
      CHECK(proxy.current_step() ==
            (out.frames.empty() ? 1 : 2));  // all between the first and the last are odd
      proxy.on_frame(frame, out);
    }
    CHECK(same_frames(out.frames, ticks));
    CHECK(out.records.empty());
    CHECK(proxy.current_step() == 3);
    CHECK(proxy.counters().odd_ticks == 6);
    CHECK(proxy.counters().passed == 8);
  }
}

TEST_CASE("the tick's step wraps with its width") {
  ProxyCore proxy({}, test_layout(), 1, 0, 1.0);
  ProxyOutput out;
  for (std::int64_t step = 1; step <= 70000; ++step) {
    out.clear();
    proxy.on_frame(tick(step & 0xFFFF), out);
  }
  CHECK(proxy.current_step() == 70001);
}

TEST_CASE("a rule acts in its window only, in steps or in model time") {
  for (const char* window : {"{first_step: 4, last_step: 6}", "{from_s: 0.4, to_s: 0.6}"}) {
    const Outcome outcome = run_proxy(
        rules_of("attacks: [{name: d, match: {messages: [Flag1]}, action: drop, window: " +
                 std::string(window) + "}]"),
        steps_of(10, three_flags), 1, 0, 0.1);
    REQUIRE(outcome.records.size() == 3);
    CHECK(outcome.records.front().step == 4);
    CHECK(outcome.records.back().step == 6);
  }
}

TEST_CASE("a comparison picks the frames by the value they carry when the rule sees them") {
  const std::vector<CanFrame> frames = {
      reading("Level", 1, "LEVEL", 4.0), reading("Level", 1, "LEVEL", 5.0),
      reading("Level", 1, "LEVEL", 7.5), reading("Level", 1, "LEVEL", 8.0),
      reading("Level", 1, "LEVEL", std::nan(""))};
  const Outcome outcome =
      run_proxy(rules_of("attacks: [{name: d, match: {messages: [Level], signal: LEVEL, at_least: "
                         "5, at_most: 7.5}, action: drop}]"),
                frames);
  CHECK(outcome.records.size() == 2);
  CHECK(outcome.records.at(0).rx_index == 1);
  CHECK(outcome.records.at(1).rx_index == 2);

  // The second rule compares what the first one wrote.
  const Outcome chained = run_proxy(rules_of(R"(
attacks:
  - {name: s, match: {messages: [Level]}, action: substitute, signal: LEVEL, value: {value: 6}}
  - {name: d, match: {messages: [Level], signal: LEVEL, at_least: 5.5, at_most: 6.5}, action: drop}
)"),
                                    frames);
  CHECK(chained.counters.dropped == 5);
  CHECK(chained.records.at(0).rule == 1);
  CHECK(value_of(chained.records.at(0).original, "LEVEL") == 4.0);
}

TEST_CASE("two alterations of one frame make one record, named after the first") {
  const Outcome outcome = run_proxy(rules_of(R"(
attacks:
  - {name: s, match: {messages: [Flag1]}, action: substitute, signal: STEP, value: {value: 99}}
  - {name: f, match: {messages: [Flag1]}, action: flip, bit: 0}
)"),
                                    {reading("Flag1", 1, "DETECT", 0)});
  REQUIRE(outcome.records.size() == 1);
  CHECK(outcome.records[0].rule == 0);
  CHECK(value_of(outcome.sent[0], "STEP") == 99.0);
  CHECK(value_of(outcome.sent[0], "DETECT") == 1.0);
  CHECK(outcome.records[0].forwarded.same_on_wire(outcome.sent[0]));
}

TEST_CASE("flip turns the named payload bit and nothing else") {
  for (int bit : {0, 7, 8, 23}) {
    const CanFrame frame = reading("Flag1", 0x1234, "DETECT", 1);
    const Outcome outcome =
        run_proxy(rules_of("attacks: [{name: f, match: {messages: [Flag1]}, action: flip, bit: " +
                           std::to_string(bit) + "}]"),
                  {frame});
    CanFrame expected = frame;
    expected.data[static_cast<std::size_t>(bit / 8)] ^= static_cast<std::uint8_t>(1 << (bit % 8));
    CHECK(outcome.sent.at(0).same_on_wire(expected));
  }
}

TEST_CASE(
    "frames too short for the signal or bit, and remote frames, are passed by rules that need a "
    "payload") {
  CanFrame short_flag = reading("Flag1", 1, "DETECT", 1);
  short_flag.num_bytes = 0;
  CanFrame remote = reading("Flag1", 1, "DETECT", 1);
  remote.flags = CanFrame::kRemote;
  for (const char* action :
       {"flip, signal: DETECT", "flip, bit: 3", "substitute, signal: STEP, value: {value: 1}"}) {
    const Outcome outcome = run_proxy(
        rules_of("attacks: [{name: f, match: {messages: [Flag1]}, action: " + std::string(action) +
                 "}]"),
        {short_flag, remote});
    CHECK(same_frames(outcome.sent, {short_flag, remote}));
    CHECK(outcome.records.empty());
  }
  const Outcome dropped =
      run_proxy(rules_of("attacks: [{name: d, match: {messages: [Flag1]}, action: drop}]"),
                {short_flag, remote});
  CHECK(dropped.counters.dropped == 2);
}

TEST_CASE("a multiplexed signal is only touched where the selector carries it") {
  CanFrame a = reading("Mux", 0, "A", 10), b = reading("Mux", 0, "B", 20);
  a.data[0] = 1;
  b.data[0] = 2;
  const Outcome outcome = run_proxy(rules_of("attacks: [{name: s, match: {messages: [Mux]}, "
                                             "action: substitute, signal: A, value: {value: 77}}]"),
                                    {a, b});
  CHECK(value_of(outcome.sent.at(0), "A") == 77.0);
  CHECK(outcome.sent.at(1).same_on_wire(b));
  const Outcome forged = run_proxy(rules_of("attacks: [{name: i, match: {messages: [Mux]}, action: "
                                            "inject, signal: B, value: {value: 9}}]"),
                                   {tick(1)});
  CHECK(value_of(forged.sent.at(0), "WHICH") == 2.0);
  CHECK(value_of(forged.sent.at(0), "B") == 9.0);
}

TEST_CASE("a nested signal is only touched and compared where all selectors above it carry it") {
  const auto nested = [](std::uint8_t page, std::uint8_t part) {
    CanFrame frame = reading("Nested", 0, "DEEP", 10);
    frame.data[0] = static_cast<std::uint8_t>(page | part << 4);
    return frame;
  };
  const std::string on_nested = "attacks: [{name: s, match: {messages: [Nested]";
  const std::string changes = "}, action: substitute, signal: DEEP, value: {value: 77}}]";
  const std::string compares = ", signal: DEEP, at_least: 9}, action: drop}]";
  for (const auto& [page, part, is_there] :
       {std::tuple{1, 2, true}, {1, 3, true}, {1, 0, false}, {0, 2, false}, {2, 3, false}}) {
    const CanFrame frame = nested(static_cast<std::uint8_t>(page), static_cast<std::uint8_t>(part));
    const Outcome changed = run_proxy(rules_of(on_nested + changes), {frame});
    CHECK(changed.sent.at(0).same_on_wire(frame) == !is_there);
    CHECK(value_of(changed.sent.at(0), "DEEP") == (is_there ? 77.0 : 10.0));
    CHECK(run_proxy(rules_of(on_nested + compares), {frame}).sent.empty() == is_there);
  }
  // A forged frame sets all of the selectors, to what all of its signals need.
  const Outcome forged = run_proxy(
      rules_of(on_nested + "}, action: inject, signals: [DEEP, DEEPER], value: {value: [9, 8]}}]"),
      {tick(1)});
  CHECK(value_of(forged.sent.at(0), "PAGE") == 1.0);
  CHECK(value_of(forged.sent.at(0), "PART") == 3.0);
  CHECK(value_of(forged.sent.at(0), "DEEP") == 9.0);
  CHECK(value_of(forged.sent.at(0), "DEEPER") == 8.0);
}

TEST_CASE("29-bit identifiers are matched by name, by mask, and never by an 11-bit rule") {
  const CanFrame wide = reading("Wide", 1, "STATE", 2);
  CanFrame stranger = wide;
  stranger.identifier = 0x18FF0002;
  const std::vector<CanFrame> frames = {wide, stranger, reading("Flag1", 1, "DETECT", 1)};
  const auto dropped = [&](const std::string& match) {
    std::vector<std::int64_t> indices;
    for (const AttackRecord& record :
         run_proxy(rules_of("attacks: [{name: d, match: " + match + ", action: drop}]"), frames)
             .records) {
      indices.push_back(record.rx_index);
    }
    return indices;
  };
  using Indices = std::vector<std::int64_t>;
  CHECK(dropped("{messages: [Wide]}") == Indices{0});
  CHECK(dropped("{identifier: 0x18FF0002, extended: true}") == Indices{1});
  CHECK(dropped("{identifier: 0x18FF0000, mask: 0x1FFFFF00, extended: true}") == Indices{0, 1});
  CHECK(dropped("{identifier: 0, mask: 0}") == Indices{2});
  CHECK(dropped("{}") == Indices{0, 1, 2});

  // Rules by name and by mask keep their order on one identifier.
  const Outcome ordered = run_proxy(rules_of(R"(
attacks:
  - {name: mask, match: {identifier: 0, mask: 0, extended: true}, action: flip, bit: 63}
  - {name: name, match: {messages: [Wide]}, action: flip, signal: STATE}
)"),
                                    frames);
  REQUIRE(ordered.records.size() == 2);
  CHECK(ordered.records[0].rule == 0);
  CHECK(value_of(ordered.sent[0], "STATE") == 3.0);
}

TEST_CASE(
    "injected frames come right before the tick and carry the step's counter plus its offset") {
  const Outcome outcome = run_proxy(rules_of(R"(
attacks:
  - name: ghosts
    match: {messages: [Flag1, Flag2]}
    action: inject
    signal: DETECT
    value: {value: 1}
    count: {mean: 2}
    counter_offset: 10
)"),
                                    steps_of(2, three_flags));
  REQUIRE(outcome.sent.size() == 16);
  const std::uint32_t expected[] = {0x101, 0x102, 0x103, 0x101, 0x101, 0x102, 0x102, 0x7F0};
  for (std::size_t i = 0; i < 16; ++i) CHECK(outcome.sent[i].identifier == expected[i % 8]);
  for (std::size_t i : {3U, 4U, 5U, 6U}) {
    CHECK(value_of(outcome.sent[i], "STEP") == 11.0);
    CHECK(value_of(outcome.sent[i + 8], "STEP") == 12.0);
    CHECK(value_of(outcome.sent[i], "DETECT") == 1.0);
  }
  CHECK(outcome.records.at(1).draw_index == 1);
  CHECK(outcome.records.at(0).disposition == Disposition::kInjected);
  CHECK(outcome.records.at(0).rx_index == -1);
  CHECK(outcome.counters.injected == 8);
}

TEST_CASE("without a tick in the layout the owner ends the steps") {
  FrameLayout layout = test_layout();
  layout.tick_message.clear();
  ProxyCore proxy(rules_of("attacks: [{name: i, match: {messages: [Flag1]}, action: inject, "
                           "signal: DETECT, value: {value: 1}}]"),
                  layout, 1, 0, 1.0);
  ProxyOutput out;
  proxy.on_frame(tick(1), out);
  CHECK(proxy.current_step() == 1);
  proxy.end_step(out);
  CHECK(proxy.current_step() == 2);
  CHECK(out.records.size() == 1);
}
