#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "attacker/attack_record.h"
#include "attacker/frame_counter.h"
#include "attacker/frame_hold.h"
#include "attacker/rule_effects.h"
#include "drivers/can/can_frame.h"
#include "drivers/can/command_codec.h"
#include "drivers/can/dbc.h"
#include "drivers/can/frame_codec.h"

namespace holdfast {

/// The man in the middle: frames of the sensor-side bus in, frames for the monitor-side bus out;
/// commands the other way.
///
/// Pure and, but for frames that a rule delays, order-preserving; of one identifier a frame
/// overtakes another only where the rule says so. Frames that are due go out before the first frame
/// of their step. Frames that no rule touches leave unchanged to the byte. Frames with the tick's
/// identifier are always passed and no rule can match them. Rules act in their order, each on what
/// the earlier ones left; no rule sees a frame that was dropped or forged. A frame that a rule
/// acted on counts as altered even when its bytes came out the same; to arm other rules is not to
/// act in that sense: it leaves no record. What was touched gets a right checksum at last, where
/// its message has one and no rule that touched it says otherwise. No allocation once the output
/// has grown to what a step needs.
class ProxyCore {
 public:
  /// Draws of rule r come from the stream "attack/<name of r>", addressed by (step, identifier,
  /// index among that identifier's frames of the step, purpose).
  /// Precondition: layout and rules were read without problems. step_s: model time of a step, > 0.
  /// monitor: asked by rules that are to stay unnoticed; they act unbounded without it.
  ProxyCore(std::vector<AttackRule> rules, const FrameLayout& layout, std::uint64_t seed,
            std::uint32_t run, double step_s, MonitorModel monitor = {});

  /// Handles one frame of the sensor-side bus. On the tick of the current step, injected frames go
  /// out before the tick.
  void on_frame(const CanFrame& frame, ProxyOutput& out);
  /// Handles one frame of the monitor-side bus: a command goes on to the plant, and so does what a
  /// driver tells sensors, which meets no rule; all else ends here.
  ///
  /// A command belongs to the step at which it is to act, so that windows and draws do not depend
  /// on when it comes by.
  void on_monitor_frame(const CanFrame& frame, ProxyOutput& out);

  /// True for a frame that on_monitor_frame() does not end.
  bool goes_back(const CanFrame& frame) const {
    return commands_.has_identifier(frame) || is_for_sensors(sensors_, frame);
  }

  /// Ends the step as its tick would, for a bus without ticks: injects, then moves to the next
  /// step.
  void end_step(ProxyOutput& out);

  /// Starts in another step than 1, as for a recording of the middle of a run. Precondition: no
  /// frame was handled yet; step > 0.
  void begin_at(std::int64_t step) {
    step_ = step;
    is_open_.assign(rules().size(), 0);
    is_bad_.assign(rules().size(), 0);
    begun_.assign(rules().size(), 0);
    effects_.begin_at(step);
    open_rules();
  }

  /// Other rules from now on, at once and whole. A rule goes on as one of the same name and action
  /// left off: its draws, counts, chain, energy, and what it remembers. Frames that are held go out
  /// when they are due, or at once where no rule acts any more. The layout is the one from before.
  void replace_rules(std::vector<AttackRule> rules, const FrameLayout& layout);
  /// How often that was done; records say under which rules they were made.
  std::int64_t generation() const { return generation_; }
  /// On how many frames a rule acted, or in how many steps a rule that forges.
  std::int64_t num_acts(std::size_t rule) const { return acts_[rule].count; }

  std::int64_t current_step() const { return step_; }
  const ProxyCounters& counters() const { return counters_; }
  const ProxyCounters& command_counters() const { return command_counters_; }
  const std::vector<AttackRule>& rules() const { return effects_.rules(); }
  /// Frames that wait for their step.
  std::size_t num_held() const { return hold_.size(); }

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
  // What rules made of the frame that passes, beside its bytes and its record.
  struct Passage {
    bool is_touched = false, is_saturated = false, is_repaired = true;
    int delay_steps = 0;
    bool reorders = false;
    std::uint32_t delayed_by = 0;  // the first of the rules that do
    double delay_draw = 0.0;
  };

  Way to_monitor(ProxyOutput& out) {
    return {AttackRecord::Direction::kToMonitor, counters_, out.frames, out.records};
  }
  Way to_plant(ProxyOutput& out) {
    return {AttackRecord::Direction::kToPlant, command_counters_, out.commands,
            out.command_records};
  }
  bool is_in_window(const AttackRule& rule) const;
  void open_rules();
  void begin_step(std::uint32_t rule);
  bool has_tick_identifier(const CanFrame& frame) const;
  bool is_current_tick(const CanFrame& frame) const;
  std::uint32_t next_index(const CanFrame& frame);
  std::uint32_t next_command_index(std::int64_t step);

  void pass(const CanFrame& frame, const Way& way);
  void meet_rules(const CanFrame& frame, std::int64_t rx_index, std::span<const RuleCandidate> list,
                  const DrawPlace& place, const Way& way);
  bool meet_rule(const RuleCandidate& candidate, std::int64_t rx_index, const DrawPlace& place,
                 const Way& way, Passage& passage);
  void complete_record(const CanFrame& frame, std::int64_t rx_index, const DrawPlace& place,
                       const Passage& passage, const Way& way);
  bool hold_back(const CanFrame& frame, std::int64_t rx_index, const DrawPlace& place,
                 Passage& passage, const Way& way);
  void release(ProxyOutput& out);
  const FrameProtection* protection_of(const CanFrame& frame) const;
  void send_copies(const AttackRecord& of, std::span<const FrameCopies> copies, const Way& way);
  void move_chain(std::uint32_t rule, const DrawPlace& place);
  void count_chance(std::uint32_t rule);
  bool decides(const RuleCandidate& candidate, const DrawPlace& place, double& draw);
  bool is_open(const RuleCandidate& candidate, std::int64_t step) const;
  bool can_act(const RuleCandidate& candidate, const CanFrame& frame) const;
  bool is_due(const AttackRule& rule, std::int64_t rx_index) const;
  bool is_due_in_step(const AttackRule& rule) const;
  void inject(const RuleCandidate& candidate, const Way& way);
  void send_forged(const RuleCandidate& candidate, const DrawPlace& place, double draw,
                   const Way& way);

  std::uint64_t seed_;
  std::uint32_t run_;
  std::int64_t generation_ = 0;
  RuleEffects effects_;
  CommandCodec commands_;
  BinarySensors sensors_;
  FrameHold hold_;
  bool flushes_ = false;             // all that is held goes out with the next frame
  std::vector<std::int64_t> begun_;  // per rule: the last step that it began, 0: none
  std::vector<char> is_open_;        // per rule: the current step lies in its window
  std::vector<Acts> acts_;           // per rule
  std::vector<char> is_bad_;         // per rule: the state of its chain
  std::vector<FrameCopies> copies_;  // of the frame that passes
  DbcMessage tick_;
  DbcSignal tick_step_;
  std::uint64_t tick_mask_ = 0;

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
