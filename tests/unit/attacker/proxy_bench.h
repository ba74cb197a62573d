#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "attacker/proxy_core.h"

namespace holdfast::test {

/// Eight messages: Flag1..Flag3 (0x101..0x103: DETECT 1 bit, STEP 16 bits), Level (0x120: LEVEL
/// float, STEP), Wide (29 bits, 0x18FF0001: STATE, STEP), Mux (0x130: WHICH, A when 1, B when 2),
/// Pair (0x140, FD: LEFT and RIGHT float, STEP), Nested (0x150: PAGE, TOP when 0, PART when 1; DEEP
/// when that is 2 or 3, DEEPER when 3), and the tick (0x7F0: STEP, 16 bits).
FrameLayout test_layout();

/// YAML text of one rule, r, on the message Pair.
std::string pair_rule(const std::string& rest);

/// Rules of YAML text "attacks: [...]"; throws ConfigurationError with all problems.
std::vector<AttackRule> rules_of(const std::string& yaml,
                                 const FrameLayout& layout = test_layout());
/// What that says; empty when all is well.
std::string problems_of(const std::string& yaml, const FrameLayout& layout = test_layout());

/// Frame of a message with its signals set by name, STEP included.
CanFrame reading(const std::string& message, std::int64_t step, const std::string& signal,
                 double value);
CanFrame tick(std::int64_t step);
double value_of(const CanFrame& frame, const std::string& signal);

struct Outcome {
  std::vector<CanFrame> sent;
  std::vector<AttackRecord> records;
  ProxyCounters counters;
};
Outcome run_proxy(const std::vector<AttackRule>& rules, const std::vector<CanFrame>& frames,
                  std::uint64_t seed = 1, std::uint32_t run = 0, double step_s = 1.0);

/// Frames of steps 1..num_steps, each ended by its tick.
std::vector<CanFrame> steps_of(int num_steps,
                               const std::function<std::vector<CanFrame>(int step)>& frames);

/// True when the frames are the same on the wire, in the same order.
bool same_frames(const std::vector<CanFrame>& a, const std::vector<CanFrame>& b);

}  // namespace holdfast::test
