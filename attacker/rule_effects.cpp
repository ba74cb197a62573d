#include "attacker/rule_effects.h"

#include <algorithm>
#include <span>
#include <utility>

namespace holdfast {
namespace {

using RuleAction = AttackRule::Action;

std::span<std::uint8_t> payload_of(CanFrame& frame) {
  return {frame.data.data(), frame.num_bytes};
}

// What the signal is to say, given what it says and what was drawn.
double new_value(RuleAction action, const DbcSignal& signal, const CanFrame& frame, double drawn) {
  if (action == RuleAction::kAdd) return signal.unpack(frame.bytes()) + drawn;
  if (action == RuleAction::kScale) return signal.unpack(frame.bytes()) * drawn;
  return drawn;
}

void edit_bytes(const PayloadEdit& edit, CanFrame& frame) {
  for (std::size_t i = 0; i < edit.keep.size(); ++i) {
    std::uint8_t& byte = frame.data[static_cast<std::size_t>(edit.at) + i];
    byte = static_cast<std::uint8_t>(((byte & edit.keep[i]) | edit.set[i]) ^ edit.flip[i]);
  }
}

bool writes_values(RuleAction action) {
  return action == RuleAction::kSubstitute || action == RuleAction::kForce ||
         action == RuleAction::kAdd || action == RuleAction::kScale;
}

}  // namespace

RuleEffects::RuleEffects(std::vector<AttackRule> rules, const FrameLayout& layout,
                         std::uint64_t seed, std::uint32_t run, double step_s, MonitorModel monitor)
    : rules_(std::move(rules)),
      table_(rules_, layout),
      over_time_(rules_.size()),
      frozen_(table_.num_targets()),
      paces_(table_.num_targets()),
      step_s_(step_s),
      monitor_(std::move(monitor)) {
  for (const AttackRule& rule : rules_) {
    streams_.emplace_back(seed, run, "attack/" + rule.name);
    energy_.push_back({rule.energy.budget, 0});
  }
}

void RuleEffects::replace_rules(std::vector<AttackRule> rules,
                                const std::vector<std::size_t>& predecessor,
                                const FrameLayout& layout, std::uint64_t seed, std::uint32_t run) {
  RuleEffects next(std::move(rules), layout, seed, run, step_s_, std::move(monitor_));
  next.table_.take_over(table_);
  for (std::size_t i = 0; i < next.rules_.size(); ++i) {
    const std::size_t old = predecessor[i];
    if (old >= rules_.size()) continue;
    next.over_time_[i] = over_time_[old];
    next.energy_[i] = energy_[old];
    next.energy_[i].left = std::min(next.energy_[i].left, next.rules_[i].energy.budget);
  }
  for (std::size_t target = 0; target < next.frozen_.size(); ++target) {
    const std::size_t old = predecessor[next.table_.target_rule(target)];
    const std::size_t from = table_.find_target(old, next.table_.target_key(target));
    if (from >= frozen_.size()) continue;
    next.frozen_[target] = frozen_[from];
    next.paces_[target] = paces_[from];
  }
  *this = std::move(next);
}

void RuleEffects::begin_step(std::uint32_t index, std::int64_t step, bool was_open) {
  const AttackRule& rule = rules_[index];
  if (!is_over_time(rule)) return;
  if (rule.values.front().kind == ValueDistribution::Kind::kRandomWalk) {
    const double added = walk_draw(rule, streams_[index], static_cast<std::uint32_t>(step));
    over_time_[index] = was_open ? over_time_[index] + added : 0.0;
    return;
  }
  over_time_[index] = rule.waveform.value(step - rule.window.first(step_s_), step_s_);
}

bool RuleEffects::pay(std::uint32_t index, std::int64_t step, double cost) {
  const EnergyBudget& budget = rules_[index].energy;
  if (!budget.is_limited()) return true;
  Energy& energy = energy_[index];
  if (energy.step > 0) {
    const double refill = budget.refill_per_step * static_cast<double>(step - energy.step);
    energy.left = std::min(budget.budget, energy.left + refill);
  }
  energy.step = step;
  if (!(cost <= energy.left)) return false;
  energy.left -= cost;
  return true;
}

double RuleEffects::cost_of(const RuleCandidate& candidate, const CanFrame& before,
                            const CanFrame& frame) const {
  if (!writes_values(rules_[candidate.rule].action)) return 1.0;
  double cost = 0.0;
  for (const DbcSignal& signal : table_.target(candidate).acted_on) {
    const double added = signal.unpack(frame.bytes()) - signal.unpack(before.bytes());
    cost += added * added;
  }
  return cost;
}

bool RuleEffects::replay(const RuleCandidate& candidate, const DrawPlace& place, std::int64_t step,
                         CanFrame& frame) const {
  const RuleTarget& target = table_.target(candidate);
  const int delay = delay_draw(rules_[candidate.rule], streams_[candidate.rule], place);
  const CanFrame* earlier = table_.remembered(target, step - delay);
  if (earlier == nullptr) return false;
  for (const DbcSignal& signal : target.acted_on) {
    if (!target.message->carries(signal, earlier->bytes())) return false;
  }
  for (const DbcSignal& signal : target.acted_on) {
    signal.set_raw(payload_of(frame), signal.raw(earlier->bytes()));
  }
  return true;
}

// False, and the frame as it was, when what is to be replayed never came.
bool RuleEffects::write_values(const RuleCandidate& candidate, const DrawPlace& place,
                               std::int64_t step, CanFrame& frame, bool& is_saturated) const {
  const RuleTarget& target = table_.target(candidate);
  const AttackRule& rule = rules_[candidate.rule];
  if (target.history >= 0) return replay(candidate, place, step, frame);
  for (std::size_t i = 0; i < target.acted_on.size(); ++i) {
    const DbcSignal& signal = target.acted_on[i];
    const double drawn = is_over_time(rule) ? rule.values[i].value * over_time_[candidate.rule]
                                            : value_draw(rule, streams_[candidate.rule], i, place);
    const double value = new_value(rule.action, signal, frame, drawn);
    is_saturated = !signal.pack(payload_of(frame), value) || is_saturated;
  }
  return true;
}

// Takes back so much of what was added that the monitor's filter would not notice.
bool RuleEffects::stay_unnoticed(const RuleCandidate& candidate, const CanFrame& before,
                                 CanFrame& frame, bool& is_saturated) const {
  const AttackRule& rule = rules_[candidate.rule];
  if (!is_stealthy(rule) || !monitor_.largest_share) return true;
  const double share = monitor_.largest_share(before, frame, rule.residual_most);
  if (!(share > 0.0)) return false;
  if (share >= 1.0) return true;
  is_saturated = false;  // what is left lies between two values that the signal can say
  for (const DbcSignal& signal : table_.target(candidate).acted_on) {
    const double from = signal.unpack(before.bytes()), to = signal.unpack(frame.bytes());
    signal.pack(payload_of(frame), from + share * (to - from));
  }
  return true;
}

void RuleEffects::freeze(const RuleCandidate& candidate, CanFrame& frame) {
  std::optional<CanFrame>& frozen = frozen_[static_cast<std::size_t>(candidate.target)];
  if (!frozen) frozen = frame;
  for (const DbcSignal& signal : table_.target(candidate).acted_on)
    signal.set_raw(payload_of(frame), signal.raw(frozen->bytes()));
}

bool RuleEffects::change(const RuleCandidate& candidate, const DrawPlace& place, std::int64_t step,
                         CanFrame& frame, bool& is_saturated) {
  const AttackRule& rule = rules_[candidate.rule];
  switch (rule.action) {
    case RuleAction::kDrop:
    case RuleAction::kArm:
    case RuleAction::kDuplicate:
    case RuleAction::kDelay:
    case RuleAction::kMasquerade:
      return true;
    case RuleAction::kFreeze:
      freeze(candidate, frame);
      return true;
    case RuleAction::kBits:
      edit_bytes(rule.edit, frame);
      return true;
    case RuleAction::kFlip:
      break;
    default:
      return write_values(candidate, place, step, frame, is_saturated);
  }
  if (rule.bit >= 0) {
    frame.data[static_cast<std::size_t>(rule.bit) / 8] ^=
        static_cast<std::uint8_t>(1U << (rule.bit % 8));
    return true;
  }
  const DbcSignal& signal = table_.target(candidate).acted_on.front();
  signal.set_raw(payload_of(frame), signal.raw(frame.bytes()) ^ 1U);
  return true;
}

bool RuleEffects::apply(const RuleCandidate& candidate, const DrawPlace& place, std::int64_t step,
                        CanFrame& frame, bool& is_saturated) {
  const AttackRule& rule = rules_[candidate.rule];
  if (!is_stealthy(rule) && !rule.energy.is_limited())
    return change(candidate, place, step, frame, is_saturated);
  const CanFrame before = frame;
  bool has_overrun = is_saturated;
  if (!change(candidate, place, step, frame, has_overrun)) return false;
  if (!stay_unnoticed(candidate, before, frame, has_overrun) ||
      !pay(candidate.rule, step, cost_of(candidate, before, frame))) {
    frame = before;
    return false;
  }
  is_saturated = has_overrun;
  return true;
}

bool RuleEffects::forge(const RuleCandidate& candidate, const DrawPlace& place, std::int64_t step,
                        CanFrame& frame, bool& is_saturated) {
  const RuleTarget& target = table_.target(candidate);
  frame = target.forged;
  if (rules_[candidate.rule].action == RuleAction::kMasquerade) {
    const CanFrame* latest = paces_[static_cast<std::size_t>(candidate.target)].latest();
    if (latest == nullptr) return false;
    frame = *latest;
    frame.receive_time_ns = 0;
    for (const DbcSignal& signal : target.acted_on) {
      if (!target.message->carries(signal, frame.bytes())) return false;
    }
  }
  return write_values(candidate, place, step, frame, is_saturated) &&
         pay(candidate.rule, step, 1.0);
}

}  // namespace holdfast
