#include "attacker/attack_messages.h"

#include <cmath>
#include <holdfast/attack_frame_t.hpp>
#include <holdfast/attack_signal_t.hpp>

#include "drivers/can/can_messages.h"

namespace holdfast {

void to_message(const AttackRecord& record, std::span<const AttackRule> rules, double step_s,
                attack_frame_t& message) {
  const AttackRule& rule = rules[record.rule];
  message.utime = std::llround(static_cast<double>(record.step) * step_s * 1e6);
  message.step = record.step;
  message.direction = static_cast<std::int32_t>(record.direction);
  message.disposition = static_cast<std::int32_t>(record.disposition);
  message.rule = rule.name;
  message.action = to_string(rule.action);
  message.actions = static_cast<std::int32_t>(record.actions);
  message.attack_class = rule.attack_class;
  message.saturated = record.is_saturated ? 1 : 0;
  message.generation = record.generation;
  message.rx_index = record.rx_index;
  message.tx_index = record.tx_index;
  message.draw_index = record.draw_index;
  message.draw = record.draw;
  to_message(record.original, record.rx_index, message.original);
  to_message(record.forwarded, record.tx_index, message.forwarded);
}

void to_message(const RuleSignal& signal, std::span<const AttackRule> rules, double step_s,
                attack_signal_t& message) {
  const AttackRule& rule = rules[signal.rule];
  message.utime = std::llround(static_cast<double>(signal.step) * step_s * 1e6);
  message.step = signal.step;
  message.name = kRuleSignalPrefix + rule.name;
  message.value.clear();
  for (const ValueDistribution& value : rule.values)
    message.value.push_back(value.value * signal.factor);
  message.num_values = static_cast<std::int32_t>(message.value.size());
}

bool from_message(const attack_frame_t& message, std::span<const AttackRule> rules,
                  AttackRecord& record) {
  if (message.disposition < attack_frame_t::ALTERED ||
      message.disposition > attack_frame_t::RELEASED)
    return false;
  if (message.direction != attack_frame_t::TO_MONITOR &&
      message.direction != attack_frame_t::TO_PLANT)
    return false;
  record.rule = 0;
  while (record.rule < rules.size() && rules[record.rule].name != message.rule) ++record.rule;
  if (record.rule == rules.size()) return false;
  record.disposition = static_cast<AttackRecord::Disposition>(message.disposition);
  record.direction = static_cast<AttackRecord::Direction>(message.direction);
  record.actions = static_cast<std::uint32_t>(message.actions);
  record.is_saturated = message.saturated != 0;
  record.step = message.step;
  record.generation = message.generation;
  record.rx_index = message.rx_index;
  record.tx_index = message.tx_index;
  record.draw_index = message.draw_index;
  record.draw = message.draw;
  return from_message(message.original, record.original) &&
         from_message(message.forwarded, record.forwarded);
}

}  // namespace holdfast
