#pragma once

#include <cstdint>
#include <vector>

#include "attacker/attack_rule.h"
#include "drivers/can/can_frame.h"

namespace holdfast {

/// Ground truth of one frame that rules touched: one record per frame, however many rules acted,
/// and a second one when a frame that was held goes out.
struct AttackRecord {
  enum class Disposition : std::int32_t {
    kAltered = 0,
    kDropped = 1,
    kInjected = 2,
    kDuplicated = 3,  // a further copy of a frame that was read
    kHeld = 4,        // taken out of the way, to be sent in a later step
    kReleased = 5     // sent then
  };
  static constexpr std::size_t kNumDispositions = 6;
  enum class Direction : std::int32_t { kToMonitor = 0, kToPlant = 1 };

  Direction direction = Direction::kToMonitor;
  Disposition disposition = Disposition::kAltered;
  std::size_t rule = 0;  // index of the rule that dropped, forged or held it, else of the first
                         // that acted
  std::uint32_t actions = 0;     // bit i: a rule with the action of number i acted
  std::int64_t step = 0;         // of a command that was read, the one at which it is to act
  std::int64_t generation = 0;   // of the rules, see ProxyCore::replace_rules
  std::int64_t rx_index = -1;    // nth frame that the proxy read this way, -1 for an injected one
  std::int64_t tx_index = -1;    // nth frame that the proxy sent this way, -1 for one not sent
  std::int64_t draw_index = 0;   // index among the identifier's frames of the step, or among the
                                 // forged ones
  double draw = 0.0;             // uniform draw that was compared with the probability
  bool is_saturated = false;     // a value did not fit its signal
  CanFrame original, forwarded;  // as read, as sent; empty where there is none

  void note(AttackRule::Action action) { actions |= 1U << static_cast<unsigned>(action); }
  bool acted(AttackRule::Action action) const {
    return (actions >> static_cast<unsigned>(action) & 1U) != 0;
  }
};

/// "altered", "dropped", "injected", "duplicated", "held", "released"; "unknown" for no
/// disposition.
const char* to_string(AttackRecord::Disposition disposition);

/// Copies that a rule wants of a frame.
struct FrameCopies {
  std::uint32_t rule = 0;
  double draw = 0.0;
};

/// Of one direction.
struct ProxyCounters {
  std::int64_t received = 0, sent = 0;
  std::int64_t passed = 0, altered = 0, dropped = 0, held = 0;
  std::int64_t injected = 0, duplicated = 0, released = 0;
  std::int64_t odd_ticks = 0;  // passed on, but they do not move the proxy's step

  bool balance() const {
    return received == passed + altered + dropped + held &&
           sent == passed + altered + injected + duplicated + released && released <= held;
  }
};

/// What a rule over time makes of a step: signal i of the rule gets values[i].value times factor.
struct RuleSignal {
  std::uint32_t rule = 0;
  std::int64_t step = 0;
  double factor = 0.0;
};

/// What is to be sent, and the truth about it; the proxy appends.
struct ProxyOutput {
  std::vector<CanFrame> frames;                        // to the monitor-side bus
  std::vector<CanFrame> commands;                      // to the sensor-side bus
  std::vector<AttackRecord> records, command_records;  // of each
  std::vector<RuleSignal> signals;  // of each step that ended, of each rule whose window it is in

  void clear() {
    frames.clear();
    commands.clear();
    records.clear();
    command_records.clear();
    signals.clear();
  }
};

}  // namespace holdfast
