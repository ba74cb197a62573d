#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "attacker/attack_rule.h"
#include "attacker/frame_history.h"
#include "attacker/rule_draws.h"
#include "common/random_stream.h"
#include "drivers/can/can_frame.h"
#include "drivers/can/dbc.h"
#include "drivers/can/frame_codec.h"

namespace holdfast {

/// Ground truth of one frame that rules touched: one record per frame, however many rules acted.
struct AttackRecord {
  enum class Disposition : std::int32_t { kAltered = 0, kDropped = 1, kInjected = 2 };

  Disposition disposition = Disposition::kAltered;
  std::size_t rule =
      0;  // index of the rule that dropped or forged it, else of the first that acted
  std::uint32_t actions = 0;  // bit i: a rule with the action of number i acted
  std::int64_t step = 0;
  std::int64_t rx_index = -1;  // nth frame that the proxy read, -1 for an injected one
  std::int64_t tx_index = -1;  // nth frame that the proxy sent, -1 for a dropped one
  std::int64_t draw_index =
      0;              // index among the identifier's frames of the step, or among the forged ones
  double draw = 0.0;  // uniform draw that was compared with the probability
  CanFrame original, forwarded;  // as read, as sent; empty where there is none

  void note(AttackRule::Action action) { actions |= 1U << static_cast<unsigned>(action); }
  bool acted(AttackRule::Action action) const {
    return (actions >> static_cast<unsigned>(action) & 1U) != 0;
  }
};

struct ProxyCounters {
  std::int64_t received = 0, sent = 0;
  std::int64_t passed = 0, altered = 0, dropped = 0;  // received = passed + altered + dropped
  std::int64_t injected = 0;                          // sent = passed + altered + injected
  std::int64_t odd_ticks = 0;  // passed on, but they do not move the proxy's step
};

/// Counts the frames of each 29-bit identifier within a step, in fixed memory.
class ExtendedFrameCounter {
 public:
  /// Number of earlier frames of this identifier in this step. Precondition: steps never decrease.
  std::uint32_t next(std::uint32_t identifier, std::int64_t step);
  /// Must be called before next().
  void allocate() { slots_.resize(kNumSlots); }

 private:
  static constexpr std::size_t kNumSlots = 1U << 16;
  static constexpr std::size_t kProbesMax = 32;
  struct Slot {
    std::int64_t step = 0;
    std::uint32_t identifier = 0, count = 0;
  };
  std::vector<Slot> slots_;
};

/// The man in the middle: frames of the sensor-side bus in, frames for the monitor-side bus out.
///
/// Pure and order-preserving. Frames that no rule touches leave unchanged to the byte. Frames with
/// the tick's identifier are always passed and no rule can match them. Rules act in their order,
/// each on what the earlier ones left; no rule sees a frame that was dropped or forged. A frame
/// that a rule acted on counts as altered even when its bytes came out the same; to arm other rules
/// is not to act in that sense: it leaves no record. No allocation once `out` and `records` have
/// grown to what a step needs.
class ProxyCore {
 public:
  /// Draws of rule r come from the stream "attack/<name of r>", addressed by (step, identifier,
  /// index among that identifier's frames of the step, purpose).
  /// Precondition: layout and rules were read without problems. step_s: model time of a step, > 0.
  ProxyCore(std::vector<AttackRule> rules, const FrameLayout& layout, std::uint64_t seed,
            std::uint32_t run, double step_s);

  /// Handles one frame; appends what is to be sent to `out` and the truth to `records`. On the tick
  /// of the current step, injected frames go out before the tick.
  void on_frame(const CanFrame& frame, std::vector<CanFrame>& out,
                std::vector<AttackRecord>& records);

  /// Ends the step as its tick would, for a bus without ticks: injects, then moves to the next
  /// step.
  void end_step(std::vector<CanFrame>& out, std::vector<AttackRecord>& records);

  std::int64_t current_step() const { return step_; }
  const ProxyCounters& counters() const { return counters_; }
  const std::vector<AttackRule>& rules() const { return rules_; }

 private:
  // Where a rule finds its signals in one message.
  struct Target {
    std::optional<DbcSignal> compared, selector;
    std::vector<DbcSignal> acted_on;
    CanFrame forged;                   // injection: the message before value and counter are set
    std::optional<DbcSignal> counter;  // injection
    std::int32_t history = -1;         // index into histories_, of a rule that replays
  };
  // A rule that may match frames of an identifier; the mask is 0 where that is settled.
  struct Candidate {
    std::uint32_t rule = 0;
    std::int32_t target = -1;  // index into targets_, -1: the rule reads no signal
    std::uint32_t identifier = 0, mask = 0;
  };

  void compile(const Dbc& dbc);
  void compile_by_identifier(std::uint32_t rule, std::vector<std::vector<Candidate>>& standard);
  void compile_by_message(std::uint32_t rule, const DbcMessage& message,
                          std::vector<std::vector<Candidate>>& standard);
  void add_extended(std::uint32_t identifier, const Candidate& candidate);
  std::optional<Target> make_target(const AttackRule& rule, const DbcMessage& message);
  void open_rules();
  void advance_in_time(std::size_t index, bool was_open);

  bool has_tick_identifier(const CanFrame& frame) const;
  bool is_current_tick(const CanFrame& frame) const;
  std::span<const Candidate> candidates(const CanFrame& frame) const;
  std::uint32_t next_index(const CanFrame& frame);
  bool can_act(const Candidate& candidate, const CanFrame& frame) const;
  bool is_due(const AttackRule& rule, std::int64_t rx_index) const;
  bool write_values(const Candidate& candidate, const DrawPlace& place, CanFrame& frame) const;
  bool alter(const Candidate& candidate, const DrawPlace& place, CanFrame& frame) const;
  std::int32_t history_for(const AttackRule& rule, std::uint32_t key);
  void remember(const CanFrame& frame);
  void inject(const Candidate& candidate, std::vector<CanFrame>& out,
              std::vector<AttackRecord>& records);

  std::vector<AttackRule> rules_;
  std::vector<RandomStream> streams_;  // one per rule
  std::vector<char> is_open_;          // per rule: the current step lies in its window
  std::vector<double> over_time_;      // per rule: waveform or walk in the current step
  // Per rule, rx_index of the frame on which it acted last: what conditions ask. An index, not a
  // flag, so that nothing has to be cleared between frames.
  std::vector<std::int64_t> last_acted_on_;
  std::vector<Target> targets_;
  std::vector<FrameHistory> histories_;
  DbcMessage tick_;
  DbcSignal tick_step_;
  std::uint64_t tick_mask_ = 0;
  double step_s_;

  // 11-bit identifiers: candidates_[offset_[id] .. offset_[id + 1]).
  std::vector<Candidate> candidates_;
  std::vector<std::uint32_t> offset_;
  // 29-bit identifiers that a message names; all others meet the rules that go by mask.
  std::unordered_map<std::uint32_t, std::vector<Candidate>> extended_;
  std::vector<Candidate> extended_by_mask_;
  std::vector<Candidate> injections_;

  struct StandardCount {
    std::int64_t step = 0;
    std::uint32_t count = 0;
  };
  std::vector<StandardCount> standard_counts_;
  ExtendedFrameCounter extended_counts_;

  std::int64_t step_ = 1;
  ProxyCounters counters_;
};

}  // namespace holdfast
