#include <map>
#include <set>

#include "attacker/proxy_core.h"
#include "common/random_stream.h"
#include "tests/support/allocation_count.h"
#include "tests/support/catch.h"
#include "tests/unit/attacker/proxy_bench.h"

using namespace holdfast;
using namespace holdfast::test;
using Disposition = AttackRecord::Disposition;

namespace {

const char* const kManyRules = R"(
attacks:
  - {name: cut, match: {identifier: 0x100, mask: 0x700}, action: drop, probability: 0.2}
  - {name: wide, match: {identifier: 0, mask: 0, extended: true}, action: flip, bit: 9, probability: 0.5}
  - {name: lie, match: {messages: [Flag1, Flag2, Flag3]}, action: flip, signal: DETECT, probability: 0.3, draw: step}
  - {name: level, match: {messages: [Level], signal: LEVEL, at_least: 0}, action: substitute, signal: LEVEL,
     value: {distribution: normal, mean: 1, std: 2}, probability: 0.6}
  - {name: armed, action: arm, probability: 0.5}
  - {name: shift, given: armed, match: {messages: [Level]}, action: add, signal: LEVEL,
     value: {distribution: normal, mean: 1, std: 2, draw: step}}
  - {name: grow, unless: [shift, cut], action: scale, signal: STEP, value: {distribution: uniform, low: -9, high: 9}}
  - {name: none, given: [armed, grow], action: force, signal: STEP, probability: 0.3, draw: step}
  - {name: any, action: flip, bit: 0, probability: 0.1}
  - {name: ghosts, match: {messages: [Flag1, Wide]}, action: inject, signal: STEP, value: {value: 3},
     count: {distribution: poisson, mean: 3}}
)";

// Hostile traffic: any identifier, width, length, format and payload; ticks of any step between.
class Storm {
 public:
  explicit Storm(std::uint64_t seed) : stream_(seed, 0, "storm") {}

  CanFrame next(std::int64_t current_step) {
    static constexpr std::uint8_t kLengths[] = {0, 1,  2,  3,  4,  5,  6,  7,
                                                8, 12, 16, 20, 24, 32, 48, 64};
    const int kind = below(10);
    if (kind == 0) return tick(current_step & 0xFFFF);
    if (kind == 1) return tick(below(1 << 16));
    if (kind < 6) {
      const char* const names[] = {"Flag1", "Flag2", "Flag3", "Level", "Wide"};
      CanFrame frame = reading(names[below(5)], below(1 << 16), "", 0.0);
      for (std::size_t i = 0; i < frame.num_bytes; ++i)
        frame.data[i] = static_cast<std::uint8_t>(below(256));
      return frame;
    }
    CanFrame frame;
    frame.flags = below(2) == 0 ? CanFrame::kExtended : 0;
    frame.identifier = static_cast<std::uint32_t>(below(frame.flags != 0 ? 1 << 29 : 1 << 11));
    const int format = below(4);
    if (format == 0) frame.flags |= CanFrame::kRemote;
    if (format == 1) frame.flags |= CanFrame::kFd;
    frame.num_bytes = kLengths[below(format == 1 ? 16 : 9)];
    if (format != 0) {
      for (std::size_t i = 0; i < frame.num_bytes; ++i)
        frame.data[i] = static_cast<std::uint8_t>(below(256));
    }
    return frame;
  }

 private:
  int below(int bound) { return static_cast<int>(stream_.uniform(1, draw_++) * bound); }

  RandomStream stream_;
  std::uint64_t draw_ = 0;
};

}  // namespace

TEST_CASE(
    "in a storm of frames every one is accounted for, in order, and the truth undoes the attack") {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    INFO(seed);
    Storm storm(seed);
    ProxyCore proxy(rules_of(kManyRules), test_layout(), seed, 0, 1.0);
    std::vector<CanFrame> received;
    ProxyOutput out;
    const std::vector<CanFrame>& sent = out.frames;
    const std::vector<AttackRecord>& records = out.records;
    std::int64_t ticks_received = 0;
    for (int i = 0; i < 20000; ++i) {
      received.push_back(storm.next(proxy.current_step()));
      if (received.back().identifier == 0x7F0 && !received.back().has(CanFrame::kExtended))
        ++ticks_received;
      proxy.on_frame(received.back(), out);
    }
    const ProxyCounters& c = proxy.counters();
    CHECK(c.received == 20000);
    CHECK(c.received == c.passed + c.altered + c.dropped);
    CHECK(c.sent == c.passed + c.altered + c.injected);
    CHECK(c.sent == static_cast<std::int64_t>(sent.size()));
    CHECK(static_cast<std::int64_t>(records.size()) == c.altered + c.dropped + c.injected);
    CHECK(proxy.current_step() - 1 + c.odd_ticks == ticks_received);
    CHECK(std::min({c.passed, c.altered, c.dropped, c.injected, c.odd_ticks}) > 500);

    // Take the injected frames out, the altered ones back, and the dropped ones in again: that is
    // the input, frame by frame. So nothing else was touched and the order was kept.
    std::map<std::int64_t, const AttackRecord*> by_rx, by_tx;
    for (const AttackRecord& record : records) {
      if (record.rx_index >= 0) REQUIRE(by_rx.emplace(record.rx_index, &record).second);
      if (record.tx_index >= 0) REQUIRE(by_tx.emplace(record.tx_index, &record).second);
      REQUIRE(record.original.identifier != 0x7F0);
    }
    std::size_t next_sent = 0;
    const auto skip_injected = [&] {
      for (;; ++next_sent) {
        const auto found = by_tx.find(static_cast<std::int64_t>(next_sent));
        if (found == by_tx.end() || found->second->disposition != Disposition::kInjected) return;
        REQUIRE(found->second->forwarded.same_on_wire(sent[next_sent]));
      }
    };
    for (std::size_t i = 0; i < received.size(); ++i) {
      const auto touched = by_rx.find(static_cast<std::int64_t>(i));
      if (touched != by_rx.end() && touched->second->disposition == Disposition::kDropped) {
        REQUIRE(touched->second->original.same_on_wire(received[i]));
        continue;
      }
      skip_injected();
      if (touched == by_rx.end()) {
        REQUIRE(sent[next_sent].same_on_wire(received[i]));
      } else {
        REQUIRE(touched->second->original.same_on_wire(received[i]));
        REQUIRE(touched->second->tx_index == static_cast<std::int64_t>(next_sent));
        REQUIRE(touched->second->forwarded.same_on_wire(sent[next_sent]));
      }
      ++next_sent;
    }
    skip_injected();
    CHECK(next_sent == sent.size());
  }
}

TEST_CASE(
    "indices of one 29-bit identifier are counted apart from all others and start anew each step") {
  ExtendedFrameCounter counter;
  counter.allocate();
  RandomStream stream(1, 0, "identifiers");
  // 4000 identifiers in 65536 slots: some 120 pairs meet in a slot.
  std::vector<std::uint32_t> identifiers;
  for (std::uint64_t i = 0; i < 4000; ++i) {
    identifiers.push_back(static_cast<std::uint32_t>(stream.uniform(0, i) * 0x20000000));
  }
  for (std::uint32_t step = 1; step <= 20; ++step) {
    std::map<std::uint32_t, std::uint32_t> expected;
    for (std::uint64_t i = 0; i < 8000; ++i) {
      const std::uint32_t identifier =
          identifiers[static_cast<std::size_t>(stream.uniform(step, i) * 4000)];
      REQUIRE(counter.next(identifier, step) == expected[identifier]++);
    }
  }
}

TEST_CASE("a flood of more identifiers than the table holds is survived") {
  ExtendedFrameCounter counter;
  counter.allocate();
  for (std::uint32_t identifier = 0; identifier < 300000; ++identifier)
    counter.next(identifier * 1789U & 0x1FFFFFFF, 1);
  CHECK(counter.next(5, 2) == 0);
  CHECK(counter.next(5, 2) == 1);
}

TEST_CASE("the proxy allocates nothing once its lists have grown") {
  Storm storm(3);
  std::vector<CanFrame> frames;
  for (int i = 0; i < 5000; ++i) frames.push_back(storm.next(0));
  ProxyCore proxy(rules_of(kManyRules), test_layout(), 1, 0, 1.0);
  ProxyOutput out;
  out.frames.reserve(64);
  out.records.reserve(64);
  const std::int64_t before = holdfast::testing::allocation_count();
  for (const CanFrame& frame : frames) {
    out.clear();
    proxy.on_frame(frame, out);
    out.clear();
    if (proxy.counters().received % 16 == 0) proxy.end_step(out);
  }
  CHECK(holdfast::testing::allocation_count() == before);
  CHECK(proxy.counters().injected > 0);
  out.frames.shrink_to_fit();
  out.frames.resize(1000);
  CHECK(holdfast::testing::allocation_count() > before);  // negative control: the count does count
}
