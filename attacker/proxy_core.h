#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "attacker/attack_rule.h"
#include "attacker/frame_counter.h"
#include "attacker/rule_draws.h"
#include "attacker/rule_table.h"
#include "common/random_stream.h"
#include "drivers/can/can_frame.h"
#include "drivers/can/command_codec.h"
#include "drivers/can/dbc.h"
#include "drivers/can/frame_codec.h"

namespace holdfast {

/// Ground truth of one frame that rules touched: one record per frame, however many rules acted.
struct AttackRecord {
  enum class Disposition : std::int32_t {
    kAltered = 0,
    kDropped = 1,
    kInjected = 2,
    kDuplicated = 3  // a further copy of a frame that was read
  };
  enum class Direction : std::int32_t { kToMonitor = 0, kToPlant = 1 };

  Direction direction = Direction::kToMonitor;
  Disposition disposition = Disposition::kAltered;
  std::size_t rule =
      0;  // index of the rule that dropped or forged it, else of the first that acted
  std::uint32_t actions = 0;   // bit i: a rule with the action of number i acted
  std::int64_t step = 0;       // of a command that was read, the one at which it is to act
  std::int64_t rx_index = -1;  // nth frame that the proxy read this way, -1 for an injected one
  std::int64_t tx_index = -1;  // nth frame that the proxy sent this way, -1 for a dropped one
  std::int64_t draw_index =
      0;              // index among the identifier's frames of the step, or among the forged ones
  double draw = 0.0;  // uniform draw that was compared with the probability
  bool is_saturated = false;     // a value did not fit its signal
  CanFrame original, forwarded;  // as read, as sent; empty where there is none

  void note(AttackRule::Action action) { actions |= 1U << static_cast<unsigned>(action); }
  bool acted(AttackRule::Action action) const {
    return (actions >> static_cast<unsigned>(action) & 1U) != 0;
  }
};

/// Of one direction.
struct ProxyCounters {
  std::int64_t received = 0, sent = 0;
  std::int64_t passed = 0, altered = 0, dropped = 0;  // received = passed + altered + dropped
  std::int64_t injected = 0, duplicated = 0;  // sent = passed + altered + injected + duplicated
  std::int64_t odd_ticks = 0;                 // passed on, but they do not move the proxy's step

  bool balance() const {
    return received == passed + altered + dropped &&
           sent == passed + altered + injected + duplicated;
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

/// The man in the middle: frames of the sensor-side bus in, frames for the monitor-side bus out;
/// commands the other way.
///
/// Pure and order-preserving. Frames that no rule touches leave unchanged to the byte. Frames with
/// the tick's identifier are always passed and no rule can match them. Rules act in their order,
/// each on what the earlier ones left; no rule sees a frame that was dropped or forged. A frame
/// that a rule acted on counts as altered even when its bytes came out the same; to arm other rules
/// is not to act in that sense: it leaves no record. What was touched gets a right checksum at
/// last, where its message has one and no rule that touched it says otherwise. No allocation once
/// the output has grown to what a step needs.
class ProxyCore {
 public:
  /// Draws of rule r come from the stream "attack/<name of r>", addressed by (step, identifier,
  /// index among that identifier's frames of the step, purpose).
  /// Precondition: layout and rules were read without problems. step_s: model time of a step, > 0.
  ProxyCore(std::vector<AttackRule> rules, const FrameLayout& layout, std::uint64_t seed,
            std::uint32_t run, double step_s);

  /// Handles one frame of the sensor-side bus. On the tick of the current step, injected frames go
  /// out before the tick.
  void on_frame(const CanFrame& frame, ProxyOutput& out);
  /// Handles one frame of the monitor-side bus: a command goes on to the plant, all else ends here.
  ///
  /// A command belongs to the step at which it is to act, so that windows and draws do not depend
  /// on when it comes by.
  void on_monitor_frame(const CanFrame& frame, ProxyOutput& out);

  /// Ends the step as its tick would, for a bus without ticks: injects, then moves to the next
  /// step.
  void end_step(ProxyOutput& out);

  /// Starts in another step than 1, as for a recording of the middle of a run. Precondition: no
  /// frame was handled yet; step > 0.
  void begin_at(std::int64_t step) {
    step_ = step;
    is_open_.assign(rules_.size(), 0);
    is_bad_.assign(rules_.size(), 0);
    open_rules();
  }

  std::int64_t current_step() const { return step_; }
  const ProxyCounters& counters() const { return counters_; }
  const ProxyCounters& command_counters() const { return command_counters_; }
  const std::vector<AttackRule>& rules() const { return rules_; }

 private:
  // What one direction has of its own.
  struct Way {
    AttackRecord::Direction direction;
    ProxyCounters& counters;
    std::vector<CanFrame>& frames;
    std::vector<AttackRecord>& records;
  };
  // How often each rule acted, and where last. An index, not a flag, so that nothing has to be
  // cleared between frames.
  struct Acts {
    std::int64_t count = 0, last_rx_index = -1, last_step = -1;
    std::int64_t chances = 0;  // frames on which it might have acted, steps of an injection
    std::int64_t last_chance = -1;
  };
  // Copies that a rule wants of the frame that passes.
  struct Copies {
    std::uint32_t rule = 0;
    double draw = 0.0;
  };

  Way to_monitor(ProxyOutput& out) {
    return {AttackRecord::Direction::kToMonitor, counters_, out.frames, out.records};
  }
  Way to_plant(ProxyOutput& out) {
    return {AttackRecord::Direction::kToPlant, command_counters_, out.commands,
            out.command_records};
  }
  void open_rules();
  void advance_in_time(std::size_t index, bool was_open);
  bool has_tick_identifier(const CanFrame& frame) const;
  bool is_current_tick(const CanFrame& frame) const;
  std::uint32_t next_index(const CanFrame& frame);
  std::uint32_t next_command_index(std::int64_t step);

  static void pass(const CanFrame& frame, Way way);
  void meet_rules(const CanFrame& frame, std::int64_t rx_index, std::span<const RuleCandidate> list,
                  const DrawPlace& place, Way way);
  const FrameProtection* protection_of(const CanFrame& frame) const;
  void send_copies(const CanFrame& frame, std::int64_t rx_index, const DrawPlace& place,
                   bool is_saturated, Way way);
  void move_chain(std::uint32_t rule, const DrawPlace& place);
  void count_chance(std::uint32_t rule);
  bool decides(const RuleCandidate& candidate, const DrawPlace& place, double& draw);
  bool is_open(const RuleCandidate& candidate, std::int64_t step) const;
  bool can_act(const RuleCandidate& candidate, const CanFrame& frame) const;
  bool is_due(const AttackRule& rule, std::int64_t rx_index) const;
  bool is_due_in_step(const AttackRule& rule) const;
  bool write_values(const RuleCandidate& candidate, const DrawPlace& place, CanFrame& frame,
                    bool& is_saturated) const;
  bool alter(const RuleCandidate& candidate, const DrawPlace& place, CanFrame& frame,
             bool& is_saturated);
  void freeze(const RuleCandidate& candidate, CanFrame& frame);
  void inject(const RuleCandidate& candidate, Way way);

  std::vector<AttackRule> rules_;
  RuleTable table_;
  CommandCodec commands_;
  std::vector<RandomStream> streams_;  // one per rule
  std::vector<char> is_open_;          // per rule: the current step lies in its window
  std::vector<double> over_time_;      // per rule: waveform or walk in the current step
  std::vector<Acts> acts_;             // per rule
  std::vector<char> is_bad_;           // per rule: the state of its chain
  // By target: what a rule keeps the signals at, once it has acted.
  std::vector<std::optional<CanFrame>> frozen_;
  std::vector<Copies> copies_;  // of the frame that passes
  DbcMessage tick_;
  DbcSignal tick_step_;
  std::uint64_t tick_mask_ = 0;
  double step_s_;

  struct Protected {
    DbcMessage message;
    FrameProtection protection;
  };
  std::vector<Protected> protected_;

  struct StandardCount {
    std::int64_t step = 0;
    std::uint32_t count = 0;
  };
  std::vector<StandardCount> standard_counts_;
  ExtendedFrameCounter extended_counts_;
  StandardCount command_count_;

  std::int64_t step_ = 1;
  ProxyCounters counters_, command_counters_;
};

}  // namespace holdfast
