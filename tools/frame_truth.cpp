#include "tools/frame_truth.h"

#include "attacker/proxy_core.h"

namespace holdfast {

AttackHypothesis true_hypothesis(std::uint32_t actions) {
  using Action = AttackRule::Action;
  AttackRecord record;
  record.actions = actions;
  if (record.acted(Action::kForce)) return AttackHypothesis::kForcedToZero;
  const bool is_biased = record.acted(Action::kAdd), is_scaled = record.acted(Action::kScale);
  if (is_biased && is_scaled) return AttackHypothesis::kBoth;
  if (is_biased) return AttackHypothesis::kBiased;
  return is_scaled ? AttackHypothesis::kScaled : AttackHypothesis::kUntouched;
}

}  // namespace holdfast
