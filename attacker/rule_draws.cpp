#include "attacker/rule_draws.h"

#include <algorithm>

namespace holdfast {
namespace {

// What a draw is used for. Each purpose owns one block of two uniforms, so that a normal value
// (which needs both) never shares a word with another draw.
enum Purpose : unsigned {
  kDecision = 0,
  kValue = 1,
  kCount = 2,
  kForgedValue = 3,
  kSharedDecision = 4,
  kReplayDelay = 5,
  kSharedValue = 6,
  kWalk = 7,
  kChain = 8,
  kSharedChain = 9,
  kFurtherValues = 16  // of the second signal, the third, ...
};
static_assert(kFurtherValues + AttackRule::kSignalsMax < 128, "a purpose has seven bits");

// key: 30 bits, index: 26 bits, purpose: 7 bits, and the two draws of a block.
std::uint64_t address(std::uint32_t key, std::uint32_t index, unsigned purpose) {
  return (static_cast<std::uint64_t>(key) << 34) |
         (static_cast<std::uint64_t>(index & 0x3FFFFFFU) << 8) |
         (static_cast<std::uint64_t>(purpose) << 1);
}

// A draw that a whole frame shares is the one that its first signal has anyway.
std::uint64_t value_address(const AttackRule& rule, std::size_t signal, const DrawPlace& place) {
  if (rule.value_draw == AttackRule::ValueDraw::kStep) return address(0, 0, kSharedValue);
  if (signal == 0 || rule.value_draw == AttackRule::ValueDraw::kFrame) {
    const bool is_forged = rule.action == AttackRule::Action::kInject;
    return address(place.key, place.index, is_forged ? kForgedValue : kValue);
  }
  return address(place.key, place.index, kFurtherValues + static_cast<unsigned>(signal));
}

}  // namespace

double decision_draw(const AttackRule& rule, const RandomStream& stream, const DrawPlace& place) {
  const bool is_shared = rule.draw == AttackRule::Draw::kStep;
  return stream.uniform(place.step, is_shared ? address(0, 0, kSharedDecision)
                                              : address(place.key, place.index, kDecision));
}

double chain_draw(const AttackRule& rule, const RandomStream& stream, const DrawPlace& place) {
  return stream.uniform(place.step, is_by_step(rule) ? address(0, 0, kSharedChain)
                                                     : address(place.key, place.index, kChain));
}

double value_draw(const AttackRule& rule, const RandomStream& stream, std::size_t signal,
                  const DrawPlace& place) {
  using Kind = ValueDistribution::Kind;
  const ValueDistribution& value = rule.values[signal];
  const std::uint64_t where = value_address(rule, signal, place);
  switch (value.kind) {
    case Kind::kConstant:
    case Kind::kReplay:
    case Kind::kWaveform:
    case Kind::kRandomWalk:
      break;
    case Kind::kUniform: {
      const double u = stream.uniform(place.step, where);
      return (1.0 - u) * value.low + u * value.high;
    }
    case Kind::kNormal:
      return value.mean + value.std * stream.normal(place.step, where);
    case Kind::kBernoulli:
      return stream.uniform(place.step, where) < value.probability ? 1.0 : 0.0;
  }
  return value.value;
}

double walk_draw(const AttackRule& rule, const RandomStream& stream, std::uint32_t step) {
  return rule.values.front().std * stream.normal(step, address(0, 0, kWalk));
}

int delay_draw(const AttackRule& rule, const RandomStream& stream, const DrawPlace& place) {
  const double u = stream.uniform(place.step, address(place.key, place.index, kReplayDelay));
  const int span = rule.delay.high - rule.delay.low + 1;
  return rule.delay.low + std::min(span - 1, static_cast<int>(u * span));
}

int count_draw(const AttackRule& rule, const RandomStream& stream, const DrawPlace& place) {
  if (rule.count.kind == CountDistribution::Kind::kConstant) {
    return static_cast<int>(rule.count.mean);
  }
  return stream.poisson(rule.count.mean, place.step, address(place.key, 0, kCount));
}

}  // namespace holdfast
