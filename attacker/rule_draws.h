#pragma once

#include <cstdint>

#include "attacker/attack_rule.h"
#include "common/random_stream.h"

namespace holdfast {

/// Where in a run a draw belongs; together with what it is for, that is its whole address.
struct DrawPlace {
  std::uint32_t step = 0;
  std::uint32_t key = 0;    // frame_key() of the frame
  std::uint32_t index = 0;  // among the identifier's frames of the step, or among the forged ones
};

/// Uniform draw that is compared with the rule's probability; the stream is the rule's own.
double decision_draw(const AttackRule& rule, const RandomStream& stream, const DrawPlace& place);

/// Uniform draw that says whether the rule's chain changes its state.
double chain_draw(const AttackRule& rule, const RandomStream& stream, const DrawPlace& place);

/// Number for signals[signal], physical units; of a rule whose values are drawn. With one draw for
/// a frame or a step the signals share the underlying uniform or standard normal number, and each
/// makes its own value of it.
double value_draw(const AttackRule& rule, const RandomStream& stream, std::size_t signal,
                  const DrawPlace& place);

/// What a random walk adds in a step.
double walk_draw(const AttackRule& rule, const RandomStream& stream, std::uint32_t step);

/// Steps back, StepDelay::low to high.
int delay_draw(const AttackRule& rule, const RandomStream& stream, const DrawPlace& place);

/// How many frames an injection forges of a message; the place's index does not matter.
int count_draw(const AttackRule& rule, const RandomStream& stream, const DrawPlace& place);

}  // namespace holdfast
