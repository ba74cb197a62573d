#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "attacker/attack_rule.h"
#include "attacker/frame_history.h"
#include "drivers/can/can_frame.h"
#include "drivers/can/dbc.h"
#include "drivers/can/frame_codec.h"

namespace holdfast {

/// Where a rule finds its signals in one message.
struct RuleTarget {
  std::uint32_t rule = 0, key = 0;            // whose it is; frame_key() of the message
  std::shared_ptr<const DbcMessage> message;  // which the targets in it share
  std::optional<DbcSignal> compared;
  std::vector<DbcSignal> acted_on;
  CanFrame forged;  // of a rule that forges: the message before value and counter are set
  std::optional<DbcSignal> counter;  // of such a rule
  std::int32_t history = -1;         // index into the table's histories, of a rule that replays
};

/// A rule that may match frames of an identifier; the mask is 0 where that is settled.
struct RuleCandidate {
  std::uint32_t rule = 0;
  std::int32_t target = -1;  // index into the table's targets, -1: the rule reads no signal
  std::uint32_t identifier = 0, mask = 0;
};

/// Which rules may match a frame: worked out once, looked up by identifier. In the order of the
/// rules.
class RuleTable {
 public:
  /// Precondition: layout and rules were read without problems.
  RuleTable(const std::vector<AttackRule>& rules, const FrameLayout& layout);

  /// For frames on their way to the monitor.
  std::span<const RuleCandidate> to_monitor(const CanFrame& frame) const;
  /// For commands on their way to the plant.
  std::span<const RuleCandidate> to_plant() const { return commands_; }
  std::span<const RuleCandidate> injections() const { return injections_; }
  const RuleTarget& target(const RuleCandidate& candidate) const {
    return targets_[static_cast<std::size_t>(candidate.target)];
  }
  std::size_t num_targets() const { return targets_.size(); }
  std::uint32_t target_rule(std::size_t target) const { return targets_[target].rule; }
  std::uint32_t target_key(std::size_t target) const { return targets_[target].key; }
  /// The target of a rule in the message of this key; num_targets() when there is none.
  std::size_t find_target(std::size_t rule, std::uint32_t key) const;
  /// Remembers what another table does.
  void take_over(const RuleTable& other);
  bool has_extended() const { return !extended_.empty() || !extended_by_mask_.empty(); }

  /// Keeps a frame that some rule may replay.
  void remember(std::int64_t step, const CanFrame& frame);
  /// The frame of that step of the target's message; null when none is kept.
  const CanFrame* remembered(const RuleTarget& target, std::int64_t step) const {
    return histories_[static_cast<std::size_t>(target.history)].find(step);
  }

 private:
  struct Draft {
    std::map<std::uint32_t, std::vector<RuleCandidate>> standard;  // by 11-bit identifier
    std::unordered_map<const DbcMessage*, std::shared_ptr<const DbcMessage>> messages;
  };

  void enter_named_extended(const std::vector<AttackRule>& rules, const Dbc& dbc);
  void enter_by_identifier(std::uint32_t index, const AttackRule& rule, Draft& draft);
  void enter_by_message(std::uint32_t index, const AttackRule& rule, const DbcMessage& message,
                        Draft& draft);
  std::optional<RuleTarget> make_target(std::uint32_t index, const AttackRule& rule,
                                        const DbcMessage& message, Draft& draft);
  std::int32_t history_for(const AttackRule& rule, std::uint32_t key);

  std::vector<RuleTarget> targets_;
  std::vector<FrameHistory> histories_;
  // 11-bit identifiers: candidates_[offset_[id] .. offset_[id + 1]).
  std::vector<RuleCandidate> candidates_;
  std::vector<std::uint32_t> offset_;
  // 29-bit identifiers that a message names; all others meet the rules that go by mask.
  std::unordered_map<std::uint32_t, std::vector<RuleCandidate>> extended_;
  std::vector<RuleCandidate> extended_by_mask_;
  std::vector<RuleCandidate> commands_, injections_;
};

}  // namespace holdfast
