#include "attacker/rule_table.h"

#include <algorithm>
#include <string>
#include <utility>

namespace holdfast {
namespace {

constexpr std::uint32_t kNumStandardIdentifiers = 1U << 11;

bool needs_signal(const AttackRule& rule) {
  return !rule.signals.empty() || !rule.match.signal.empty();
}

// Rules without names and signals act on what has no message in the DBC file, too.
bool goes_by_identifier(const AttackRule& rule) {
  return !forges(rule) && rule.match.messages.empty() && !needs_signal(rule);
}

std::optional<DbcSignal> copy_of(const DbcSignal* signal) {
  return signal == nullptr ? std::nullopt : std::optional<DbcSignal>(*signal);
}

}  // namespace

RuleTable::RuleTable(const std::vector<AttackRule>& rules, const FrameLayout& layout) {
  Draft draft;
  enter_named_extended(rules, layout.dbc);
  for (std::uint32_t index = 0; index < rules.size(); ++index) {
    const AttackRule& rule = rules[index];
    if (goes_by_identifier(rule)) {
      enter_by_identifier(index, rule, draft);
      continue;
    }
    for (const DbcMessage& message : layout.dbc.messages) {
      if (!can_select(rule.match, message, layout)) continue;
      enter_by_message(index, rule, message, draft);
    }
  }
  offset_.reserve(kNumStandardIdentifiers + 1);
  for (const auto& [identifier, list] : draft.standard) {
    offset_.resize(identifier + 1, static_cast<std::uint32_t>(candidates_.size()));
    candidates_.insert(candidates_.end(), list.begin(), list.end());
  }
  offset_.resize(kNumStandardIdentifiers + 1, static_cast<std::uint32_t>(candidates_.size()));
}

// The identifiers that stand by themselves come first, so that rules by mask reach them in the
// order of the rules.
void RuleTable::enter_named_extended(const std::vector<AttackRule>& rules, const Dbc& dbc) {
  for (const AttackRule& rule : rules) {
    if (rule.action == AttackRule::Action::kInject || goes_by_identifier(rule)) continue;
    for (const DbcMessage& message : dbc.messages) {
      if (message.is_extended && selects(rule.match, message)) extended_[message.identifier];
    }
  }
}

void RuleTable::enter_by_identifier(std::uint32_t index, const AttackRule& rule, Draft& draft) {
  const AttackMatch& match = rule.match;
  for (std::uint32_t identifier = 0; identifier < kNumStandardIdentifiers; ++identifier) {
    if (match.matches_identifier(identifier, false))
      draft.standard[identifier].push_back({index, -1, 0, 0});
  }
  if (match.identifier && !match.is_extended) return;
  extended_by_mask_.push_back(
      {index, -1, match.identifier.value_or(0), match.identifier ? match.mask : 0});
  for (auto& [identifier, list] : extended_) {
    if (match.matches_identifier(identifier, true)) list.push_back({index, -1, 0, 0});
  }
}

void RuleTable::enter_by_message(std::uint32_t index, const AttackRule& rule,
                                 const DbcMessage& message, Draft& draft) {
  RuleCandidate candidate{index, -1, 0, 0};
  if (needs_signal(rule) || forges(rule)) {
    std::optional<RuleTarget> target = make_target(index, rule, message, draft);
    if (!target) return;
    candidate.target = static_cast<std::int32_t>(targets_.size());
    targets_.push_back(std::move(*target));
  }
  if (forges(rule)) injections_.push_back(candidate);
  if (rule.action == AttackRule::Action::kInject) return;
  std::vector<RuleCandidate>& list = rule.is_on_way_back   ? commands_
                                     : message.is_extended ? extended_[message.identifier]
                                                           : draft.standard[message.identifier];
  // A DBC that lists an identifier twice must not make a rule act twice.
  if (list.empty() || list.back().rule != index) list.push_back(candidate);
}

std::optional<RuleTarget> RuleTable::make_target(std::uint32_t index, const AttackRule& rule,
                                                 const DbcMessage& message, Draft& draft) {
  RuleTarget target;
  target.rule = index;
  target.key = frame_key(message.identifier, message.is_extended);
  if (!rule.match.signal.empty()) {
    target.compared = copy_of(message.find(rule.match.signal));
    if (!target.compared) return std::nullopt;
  }
  std::optional<std::vector<DbcSignal>> acted_on = find_signals(message, rule.signals);
  if (!acted_on) return std::nullopt;
  target.acted_on = std::move(*acted_on);
  if (forges(rule)) {
    const std::optional<CanFrame> forged = frame_to_forge(rule, message);
    if (!forged) return std::nullopt;
    target.forged = *forged;
    if (!rule.counter_signal.empty()) target.counter = copy_of(message.find(rule.counter_signal));
  }
  if (replays(rule)) target.history = history_for(rule, target.key);
  std::shared_ptr<const DbcMessage>& shared = draft.messages[&message];
  if (shared == nullptr) shared = std::make_shared<const DbcMessage>(message);
  target.message = shared;
  return target;
}

// Rules that replay one message share its history.
std::int32_t RuleTable::history_for(const AttackRule& rule, std::uint32_t key) {
  auto found = std::find_if(histories_.begin(), histories_.end(),
                            [key](const FrameHistory& history) { return history.key() == key; });
  if (found == histories_.end()) found = histories_.emplace(found, key);
  found->reach_back(rule.delay.high);
  return static_cast<std::int32_t>(found - histories_.begin());
}

std::size_t RuleTable::find_target(std::size_t rule, std::uint32_t key) const {
  const auto found = std::ranges::find_if(
      targets_, [&](const RuleTarget& target) { return target.rule == rule && target.key == key; });
  return static_cast<std::size_t>(found - targets_.begin());
}

void RuleTable::take_over(const RuleTable& other) {
  for (FrameHistory& history : histories_) {
    for (const FrameHistory& earlier : other.histories_) {
      if (earlier.key() == history.key()) history.take_over(earlier);
    }
  }
}

void RuleTable::remember(std::int64_t step, const CanFrame& frame) {
  if (frame.has(CanFrame::kRemote)) return;
  const std::uint32_t key = frame_key(frame.identifier, frame.has(CanFrame::kExtended));
  for (FrameHistory& history : histories_) {
    if (history.key() == key) history.remember(step, frame);
  }
}

std::span<const RuleCandidate> RuleTable::to_monitor(const CanFrame& frame) const {
  if (!frame.has(CanFrame::kExtended)) {
    const std::uint32_t identifier = frame.identifier % kNumStandardIdentifiers;
    return {candidates_.data() + offset_[identifier],
            offset_[identifier + 1] - offset_[identifier]};
  }
  if (!extended_.empty()) {
    const auto found = extended_.find(frame.identifier);
    if (found != extended_.end()) return found->second;
  }
  return extended_by_mask_;
}

}  // namespace holdfast
