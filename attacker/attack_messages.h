#pragma once

#include <cstdint>
#include <span>

#include "attacker/proxy_core.h"

namespace holdfast {

class attack_frame_t;
class attack_signal_t;

/// Fills the message but for seq; utime is the time of validity of the step, step * step_s.
/// Precondition: record.rule is an index into the rules.
void to_message(const AttackRecord& record, std::span<const AttackRule> rules, double step_s,
                attack_frame_t& message);

/// The proxy's attack signals are called by this and the rule's name.
inline constexpr char kRuleSignalPrefix[] = "rule/";

/// Fills the message but for seq: one value for each signal of the rule, what it adds or writes
/// where it acts.
void to_message(const RuleSignal& signal, std::span<const AttackRule> rules, double step_s,
                attack_signal_t& message);

/// Fills the record from a message that passed the guard. Returns false when the disposition or a
/// frame is none that a proxy could have written, or when no rule has the message's name.
bool from_message(const attack_frame_t& message, std::span<const AttackRule> rules,
                  AttackRecord& record);

}  // namespace holdfast
