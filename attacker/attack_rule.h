#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "attacker/attack_match.h"
#include "common/configuration.h"
#include "common/step_window.h"
#include "common/waveform.h"
#include "drivers/can/frame_codec.h"

namespace holdfast {

/// Where the number comes from that a rule writes into a signal, adds to it or multiplies it by;
/// physical units of the signal, a factor has none.
struct ValueDistribution {
  // kWaveform and kRandomWalk: one number a step, times `value`; a walk starts at 0 in the first
  // step of the rule's window and adds N(0, std^2) in each later one.
  enum class Kind { kConstant, kUniform, kNormal, kBernoulli, kReplay, kWaveform, kRandomWalk };

  Kind kind = Kind::kConstant;
  double value = 0.0;            // constant
  double low = 0.0, high = 1.0;  // uniform, low <= high
  double mean = 0.0, std = 1.0;  // normal, std >= 0
  double probability = 0.5;      // bernoulli: 1 with this probability, else 0
};

/// Steps between what was read and what is sent; a uniform whole number. Of Kind::kReplay: values
/// of the genuine frame of the same message that the proxy read first in the step that lies so far
/// back; a rule does nothing where there is none. Of Action::kDelay: how long a frame is held.
struct StepDelay {
  static constexpr int kMax = 10000;

  int low = 1, high = 1;
};

/// Decides in bursts, in place of one probability: a chain of two states (Gilbert 1960, Elliott
/// 1963), good at first, that may change each time before the rule decides.
struct BurstChain {
  double to_bad = 0.0, to_good = 1.0;  // probabilities of a change
  double in_bad = 1.0, in_good = 0.0;  // probability that the rule acts there
};

/// What happens to bytes of a payload: data[at + i] becomes ((data & keep[i]) | set[i]) ^ flip[i].
struct PayloadEdit {
  int at = 0;                                 // 0..63
  std::vector<std::uint8_t> keep, set, flip;  // of one size
};

/// What a rule may spend: the squares of what it adds to signals, in their units, summed; or one
/// for each frame on which it acts in another way. It does not act where that would cost more than
/// is left.
struct EnergyBudget {
  double budget = std::numeric_limits<double>::infinity();  // at first, and at most
  double refill_per_step = 0.0;

  bool is_limited() const { return budget != std::numeric_limits<double>::infinity(); }
};

/// How many frames an injection forges, per step and matched message.
struct CountDistribution {
  enum class Kind { kConstant, kPoisson };
  static constexpr double kMax = 500.0;

  Kind kind = Kind::kConstant;
  double mean = 1.0;  // the count itself when constant; 0..kMax
};

/// One rule of the attacker, as the list `attacks` of a scenario states it (docs/attacks.md).
struct AttackRule {
  enum class Action : std::int32_t {
    kDrop = 0,
    kFlip = 1,
    kSubstitute = 2,
    kInject = 3,
    kForce = 4,  // as kSubstitute, with a constant zero for default
    kAdd = 5,
    kScale = 6,
    kArm = 7,  // touches nothing: other rules refer to it
    kBits = 8,
    kFreeze = 9,  // the signals stay as they were in the first frame on which the rule acted
    kDuplicate = 10,
    kDelay = 11,
    kMasquerade = 12  // suspends a sender and forges its frames at the pace that it had
  };
  enum class Draw { kFrame, kStep };  // kStep: one decision is shared by all frames of a step
  // What shares one draw: nothing, the signals of a frame, or those of all frames of a step.
  enum class ValueDraw { kSignal, kFrame, kStep };

  std::string name;
  bool is_paused = false;  // by whoever controls a running attacker
  bool is_gone = false;    // taken away, but named by frames that are still held
  AttackMatch match;
  StepWindow window;
  std::int64_t every = 1;  // of the frames on which it might act only each so manieth
  double probability = 1.0;
  std::optional<BurstChain> chain;  // in place of the probability
  Draw draw = Draw::kFrame;
  Action action = Action::kDrop;
  // The rule acts on commands, on their way to the plant; else on what goes to the monitor.
  bool is_on_way_back = false;
  std::int64_t times = std::numeric_limits<std::int64_t>::max();  // that it acts, at most
  // Indices of earlier rules. The rule acts only on frames on which all of `given` acted and none
  // of `unless` did; an injection, in steps in which they did.
  std::vector<std::uint32_t> given, unless;

  static constexpr std::size_t kSignalsMax = 100;
  static constexpr std::size_t kRulesMax = 256;  // of a scenario
  std::vector<std::string> signals;              // flip: one; with values: at least one
  std::string attack_class;  // what the truth calls it: "alteration", "suspension", ...
  bool repairs = true;       // checksums of what it touched, so that receivers take it
  PayloadEdit edit;          // bits
  int copies = 1;            // duplicate
  int bit = -1;              // flip: payload bit as a DBC counts, -1 when a signal is flipped
  // Substitute, force, add, scale, inject: one per signal, all of one kind.
  std::vector<ValueDistribution> values;
  ValueDraw value_draw = ValueDraw::kSignal;
  StepDelay delay;        // replay, delay
  bool reorders = false;  // delay: later frames of the identifier may overtake
  EnergyBudget energy;
  // Add: what is added is made smaller, to nothing if need be, so that the normalised residual of
  // the frame, by a Kalman filter of what was sent, is at most this.
  double residual_most = std::numeric_limits<double>::infinity();
  Waveform waveform;           // of that kind; begins with the first step of the window
  CountDistribution count;     // inject
  std::string counter_signal;  // inject: set to step + counter_offset; "" for none. Of a command,
                               // the step at which it is to act
  std::int64_t counter_offset = 0;
};

const char* to_string(AttackRule::Action action);
/// True when the rule stays below what a filter would notice.
inline bool is_stealthy(const AttackRule& rule) {
  return rule.residual_most != std::numeric_limits<double>::infinity();
}
/// True when no frame on which the rule acts goes on.
inline bool suspends(const AttackRule& rule) {
  return rule.action == AttackRule::Action::kDrop || rule.action == AttackRule::Action::kMasquerade;
}
/// True when the rule makes frames of its own.
inline bool forges(const AttackRule& rule) {
  return rule.action == AttackRule::Action::kInject ||
         rule.action == AttackRule::Action::kMasquerade;
}
/// The frame that a forgery of this message begins as: zero but for the selectors that the rule's
/// signals, and the counter of an injection, need. None when no frame carries them all, or a
/// selector among them is written with a constant that does not carry the others.
std::optional<CanFrame> frame_to_forge(const AttackRule& rule, const DbcMessage& message);
/// True when whether the rule acts depends on what it or earlier rules did before.
inline bool is_conditional(const AttackRule& rule) {
  return !rule.given.empty() || !rule.unless.empty() || rule.every != 1 || rule.chain ||
         rule.energy.is_limited() || is_stealthy(rule) ||
         rule.times != std::numeric_limits<std::int64_t>::max();
}
/// True when the rule's chain moves with the steps, not with the frames.
inline bool is_by_step(const AttackRule& rule) {
  return rule.draw == AttackRule::Draw::kStep || rule.action == AttackRule::Action::kInject;
}
/// True when the rule takes its values from earlier frames.
inline bool replays(const AttackRule& rule) {
  return !rule.values.empty() && rule.values.front().kind == ValueDistribution::Kind::kReplay;
}

/// True when the rule's values follow from the step alone.
inline bool is_over_time(const AttackRule& rule) {
  using Kind = ValueDistribution::Kind;
  return !rule.values.empty() && (rule.values.front().kind == Kind::kWaveform ||
                                  rule.values.front().kind == Kind::kRandomWalk);
}

/// Rules below the list key `attacks` of the map, in their order; none when there is no such key.
///
/// The layout says which names exist, which message is the tick, and the default counter signal.
/// Every problem is reported on the map; rules are usable only when there was none. folder: that of
/// the scenario, for a waveform's file.
std::vector<AttackRule> read_attack_rules(ConfigurationMap parent, const FrameLayout& layout,
                                          const std::string& folder = "");

}  // namespace holdfast
