#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "attacker/attack_rule.h"
#include "attacker/rule_draws.h"
#include "attacker/rule_table.h"
#include "attacker/sender_pace.h"
#include "common/random_stream.h"

namespace holdfast {

/// A filter that the attacker runs in the monitor's place, on what he sends; for rules that are to
/// stay below what it would notice. All empty when no rule asks for it.
struct MonitorModel {
  /// Largest share, 0 to 1, of the change from one frame to the other that leaves the normalised
  /// residual of the frame at or below residual_most; below 0 when it lies above without any
  /// change.
  std::function<double(const CanFrame& frame, const CanFrame& changed, double residual_most)>
      largest_share;
  std::function<void(const CanFrame& sent)> take;
  std::function<void()> end_step;
  std::function<void(std::int64_t step)> begin_at;  // in place of step 1
};

/// What rules do to frames, and what they remember for it. Pure but for the monitor's model.
class RuleEffects {
 public:
  /// Draws of rule r come from the stream "attack/<name of r>". Precondition: layout and rules were
  /// read without problems. step_s: model time of a step, > 0.
  RuleEffects(std::vector<AttackRule> rules, const FrameLayout& layout, std::uint64_t seed,
              std::uint32_t run, double step_s, MonitorModel monitor);

  /// Other rules. predecessor[i]: the rule that number i goes on as, with what it remembers; beyond
  /// the rules there are: none.
  void replace_rules(std::vector<AttackRule> rules, const std::vector<std::size_t>& predecessor,
                     const FrameLayout& layout, std::uint64_t seed, std::uint32_t run);

  const std::vector<AttackRule>& rules() const { return rules_; }
  const RuleTable& table() const { return table_; }
  const RandomStream& stream(std::uint32_t rule) const { return streams_[rule]; }
  double step_s() const { return step_s_; }
  /// What a rule over time makes of the current step.
  double over_time(std::uint32_t rule) const { return over_time_[rule]; }

  /// A step of the rule's window begins; was_open: the one before was one, too.
  void begin_step(std::uint32_t rule, std::int64_t step, bool was_open);
  /// A genuine frame came, before any rule.
  void remember(std::int64_t step, const CanFrame& frame) { table_.remember(step, frame); }
  /// It is one of a sender that a masquerade will silence, in a step outside its window.
  void learn(const RuleCandidate& candidate, std::int64_t step, const CanFrame& frame) {
    paces_[static_cast<std::size_t>(candidate.target)].learn(step, frame);
  }
  /// A frame goes to the monitor.
  void on_sent(const CanFrame& frame) {
    if (monitor_.take) monitor_.take(frame);
  }
  void end_step() {
    if (monitor_.end_step) monitor_.end_step();
  }
  /// The first step is this one, not 1.
  void begin_at(std::int64_t step) {
    if (monitor_.begin_at) monitor_.begin_at(step);
  }

  /// Does to the frame what the rule's action says. False, and the frame as it was, when it cannot:
  /// what is to be replayed never came, the energy does not suffice, nothing can be added
  /// unnoticed.
  bool apply(const RuleCandidate& candidate, const DrawPlace& place, std::int64_t step,
             CanFrame& frame, bool& is_saturated);
  /// The frame that a rule forges, its values written; false when it cannot.
  bool forge(const RuleCandidate& candidate, const DrawPlace& place, std::int64_t step,
             CanFrame& frame, bool& is_saturated);
  /// How many frames a masquerade sends at the end of this step of its window.
  int num_due(const RuleCandidate& candidate, std::int64_t step) {
    return paces_[static_cast<std::size_t>(candidate.target)].due(step);
  }

 private:
  struct Energy {
    double left = 0.0;
    std::int64_t step = 0;  // up to which it was filled up
  };

  bool pay(std::uint32_t rule, std::int64_t step, double cost);
  bool write_values(const RuleCandidate& candidate, const DrawPlace& place, std::int64_t step,
                    CanFrame& frame, bool& is_saturated) const;
  bool replay(const RuleCandidate& candidate, const DrawPlace& place, std::int64_t step,
              CanFrame& frame) const;
  bool stay_unnoticed(const RuleCandidate& candidate, const CanFrame& before, CanFrame& frame,
                      bool& is_saturated) const;
  double cost_of(const RuleCandidate& candidate, const CanFrame& before,
                 const CanFrame& frame) const;
  void freeze(const RuleCandidate& candidate, CanFrame& frame);
  bool change(const RuleCandidate& candidate, const DrawPlace& place, std::int64_t step,
              CanFrame& frame, bool& is_saturated);

  std::vector<AttackRule> rules_;
  RuleTable table_;
  std::vector<RandomStream> streams_;  // one per rule
  std::vector<double> over_time_;      // per rule: waveform or walk in the current step
  std::vector<Energy> energy_;         // per rule
  // By target: what a rule keeps the signals at, once it has acted; the pace of a sender.
  std::vector<std::optional<CanFrame>> frozen_;
  std::vector<SenderPace> paces_;
  double step_s_;
  MonitorModel monitor_;
};

}  // namespace holdfast
