// Which rules act, and when others take their place.

#include <algorithm>
#include <type_traits>
#include <utility>

#include "attacker/proxy_core.h"

namespace holdfast {
namespace {

constexpr std::size_t kNone = static_cast<std::size_t>(-1);

// The rule that goes on as this one: of its name, and doing the same. kNone when there is none.
std::size_t successor_of(const AttackRule& rule, const std::vector<AttackRule>& rules) {
  if (rule.is_gone) return kNone;
  const auto found = std::ranges::find_if(rules, [&rule](const AttackRule& other) {
    return other.name == rule.name && other.action == rule.action &&
           other.attack_class == rule.attack_class && other.copies == rule.copies;
  });
  return found == rules.end() ? kNone : static_cast<std::size_t>(found - rules.begin());
}

}  // namespace

bool ProxyCore::is_in_window(const AttackRule& rule) const {
  return !rule.is_paused && rule.probability > 0.0 &&
         rule.window.contains(step_, effects_.step_s());
}

void ProxyCore::open_rules() {
  is_open_.resize(rules().size());
  begun_.resize(rules().size());
  for (std::uint32_t index = 0; index < rules().size(); ++index) {
    is_open_[index] = is_in_window(rules()[index]) ? 1 : 0;
    if (is_open_[index] != 0) begin_step(index);
  }
}

// Once in each step, however often the rule is paused in it.
void ProxyCore::begin_step(std::uint32_t index) {
  if (begun_[index] == step_) return;
  const AttackRule& rule = rules()[index];
  if (rule.chain && is_by_step(rule)) move_chain(index, {static_cast<std::uint32_t>(step_), 0, 0});
  effects_.begin_step(index, step_, begun_[index] > 0);
  begun_[index] = step_;
}

void ProxyCore::replace_rules(std::vector<AttackRule> next, const FrameLayout& layout) {
  const std::vector<AttackRule>& before = rules();
  std::vector<std::size_t> successor(before.size()), predecessor(next.size(), kNone);
  for (std::size_t old = 0; old < before.size(); ++old) {
    successor[old] = successor_of(before[old], next);
    if (successor[old] != kNone) predecessor[successor[old]] = old;
  }
  const bool is_quiet =
      std::ranges::all_of(next, [](const AttackRule& rule) { return rule.is_paused; });
  // What is held still names its rule: those that are gone stay in the list, without effect.
  for (std::size_t old = 0; old < before.size(); ++old) {
    if (successor[old] != kNone || !hold_.names(old)) continue;
    AttackRule gone = before[old];
    gone.is_paused = gone.is_gone = true;
    gone.given.clear();
    gone.unless.clear();
    successor[old] = next.size();
    predecessor.push_back(kNone);
    next.push_back(std::move(gone));
  }
  hold_.renumber_rules([&](std::size_t old) { return successor[old]; });
  const auto carried = [&](const auto& values) {
    std::remove_cvref_t<decltype(values)> result(next.size());
    for (std::size_t i = 0; i < next.size(); ++i) {
      if (predecessor[i] != kNone) result[i] = values[predecessor[i]];
    }
    return result;
  };
  acts_ = carried(acts_);
  is_bad_ = carried(is_bad_);
  begun_ = carried(begun_);
  effects_.replace_rules(std::move(next), predecessor, layout, seed_, run_);
  if (effects_.table().has_extended()) extended_counts_.allocate();
  ++generation_;
  // Who stops all rules wants frames to pass: those that wait, too.
  flushes_ = is_quiet;
  open_rules();
}

void ProxyCore::move_chain(std::uint32_t rule, const DrawPlace& place) {
  const BurstChain& chain = *rules()[rule].chain;
  const double draw = chain_draw(rules()[rule], effects_.stream(rule), place);
  if (draw < (is_bad_[rule] != 0 ? chain.to_good : chain.to_bad)) is_bad_[rule] ^= 1;
}

// Whether the rule acts on a frame on which it may: in its turn, and by its draw.
bool ProxyCore::decides(const RuleCandidate& candidate, const DrawPlace& place, double& draw) {
  const AttackRule& rule = rules()[candidate.rule];
  std::int64_t& chances = acts_[candidate.rule].chances;
  if (rule.action != AttackRule::Action::kInject) ++chances;
  if (chances % rule.every != 0) return false;
  if (rule.chain && !is_by_step(rule)) move_chain(candidate.rule, place);
  draw = decision_draw(rule, effects_.stream(candidate.rule), place);
  if (!rule.chain) return draw < rule.probability;
  return draw < (is_bad_[candidate.rule] != 0 ? rule.chain->in_bad : rule.chain->in_good);
}

// The conditions on what earlier rules did to this frame.
bool ProxyCore::is_due(const AttackRule& rule, std::int64_t rx_index) const {
  const auto acted = [this, rx_index](std::uint32_t earlier) {
    return acts_[earlier].last_rx_index == rx_index;
  };
  return std::all_of(rule.given.begin(), rule.given.end(), acted) &&
         std::none_of(rule.unless.begin(), rule.unless.end(), acted);
}

// The same for an injection, which joins no frame: on what they did in this step.
bool ProxyCore::is_due_in_step(const AttackRule& rule) const {
  const auto acted = [this](std::uint32_t earlier) { return acts_[earlier].last_step == step_; };
  return std::all_of(rule.given.begin(), rule.given.end(), acted) &&
         std::none_of(rule.unless.begin(), rule.unless.end(), acted);
}

bool ProxyCore::is_open(const RuleCandidate& candidate, std::int64_t step) const {
  const AttackRule& rule = rules()[candidate.rule];
  if (acts_[candidate.rule].count >= rule.times) return false;
  if (!rule.is_on_way_back) return is_open_[candidate.rule] != 0;
  return !rule.is_paused && rule.probability > 0.0 && rule.window.contains(step, effects_.step_s());
}

bool ProxyCore::can_act(const RuleCandidate& candidate, const CanFrame& frame) const {
  if (((candidate.identifier ^ frame.identifier) & candidate.mask) != 0) return false;
  const AttackRule& rule = rules()[candidate.rule];
  // A sender is silenced whatever form its frames have.
  if (rule.action == AttackRule::Action::kMasquerade) return true;
  if (!rule.match.matches_content(frame)) return false;
  if (frame.has(CanFrame::kRemote)) {
    using Action = AttackRule::Action;
    const bool needs_payload = rule.action != Action::kDrop && rule.action != Action::kArm &&
                               rule.action != Action::kDuplicate && rule.action != Action::kDelay;
    return !needs_payload && candidate.target < 0;
  }
  if (rule.bit >= 8 * frame.num_bytes) return false;
  if (static_cast<std::size_t>(rule.edit.at) + rule.edit.keep.size() > frame.num_bytes)
    return false;
  if (candidate.target < 0) return true;
  const RuleTarget& target = effects_.table().target(candidate);
  for (const DbcSignal& signal : target.acted_on) {
    if (!target.message->carries(signal, frame.bytes())) return false;
  }
  if (!target.compared) return true;
  if (!target.message->carries(*target.compared, frame.bytes())) return false;
  const double value = target.compared->unpack(frame.bytes());
  return value >= rule.match.at_least && value <= rule.match.at_most;
}

// An injection has one chance a step, whatever the number of its messages.
void ProxyCore::count_chance(std::uint32_t rule) {
  Acts& acts = acts_[rule];
  if (is_open_[rule] == 0 || acts.last_chance == step_) return;
  acts.last_chance = step_;
  ++acts.chances;
}

}  // namespace holdfast
