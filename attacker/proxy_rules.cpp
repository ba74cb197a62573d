// Which rules act, and when others take their place.

#include <algorithm>
#include <utility>

#include "attacker/proxy_core.h"

namespace holdfast {
namespace {

// Index of the rule of this name; the number of rules when there is none.
std::size_t find_rule(const std::vector<AttackRule>& rules, const std::string& name) {
  const auto found =
      std::ranges::find_if(rules, [&name](const AttackRule& rule) { return rule.name == name; });
  return static_cast<std::size_t>(found - rules.begin());
}

}  // namespace

bool ProxyCore::is_in_window(const AttackRule& rule) const {
  return !rule.is_paused && rule.probability > 0.0 &&
         rule.window.contains(step_, effects_.step_s());
}

void ProxyCore::open_rules() {
  is_open_.resize(rules().size());
  for (std::uint32_t index = 0; index < rules().size(); ++index) {
    const bool was_open = is_open_[index] != 0;
    is_open_[index] = is_in_window(rules()[index]) ? 1 : 0;
    if (is_open_[index] != 0) begin_step(index, was_open);
  }
}

void ProxyCore::begin_step(std::uint32_t index, bool was_open) {
  const AttackRule& rule = rules()[index];
  if (rule.chain && is_by_step(rule)) move_chain(index, {static_cast<std::uint32_t>(step_), 0, 0});
  effects_.begin_step(index, step_, was_open);
}

void ProxyCore::replace_rules(std::vector<AttackRule> next, const FrameLayout& layout) {
  const std::vector<AttackRule>& before = rules();
  // What is held still names its rule: those that are gone stay in the list, without effect.
  for (const AttackRule& rule : before) {
    if (hold_.is_empty() || find_rule(next, rule.name) < next.size()) continue;
    AttackRule gone = rule;
    gone.is_paused = true;
    gone.given.clear();
    gone.unless.clear();
    next.push_back(std::move(gone));
  }
  hold_.renumber_rules([&](std::size_t index) { return find_rule(next, before[index].name); });
  std::vector<Acts> acts(next.size());
  std::vector<char> was_open(next.size(), 0), is_bad(next.size(), 0);
  for (std::size_t i = 0; i < next.size(); ++i) {
    const std::size_t old = find_rule(before, next[i].name);
    if (old == before.size()) continue;
    acts[i] = acts_[old];
    was_open[i] = is_open_[old];
    is_bad[i] = is_bad_[old];
  }
  effects_.replace_rules(std::move(next), layout, seed_, run_);
  acts_ = std::move(acts);
  is_bad_ = std::move(is_bad);
  is_open_ = was_open;
  if (effects_.table().has_extended()) extended_counts_.allocate();
  ++generation_;
  // In the middle of a step: what goes on has begun it already.
  for (std::uint32_t index = 0; index < rules().size(); ++index) {
    is_open_[index] = is_in_window(rules()[index]) ? 1 : 0;
    if (is_open_[index] != 0 && was_open[index] == 0) begin_step(index, false);
  }
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
    if (!has_signal(frame, signal, target.selector)) return false;
  }
  if (!target.compared) return true;
  if (!has_signal(frame, *target.compared, target.selector)) return false;
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
