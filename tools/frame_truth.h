#pragma once

#include <cstdint>

#include "estimators/attack_statistics.h"

namespace holdfast {

/// What rules did to a step's frames, from AttackRecord::actions of all of them together: the true
/// hypothesis of the filters that ask for it. Actions that none of these speaks of leave it
/// untouched.
AttackHypothesis true_hypothesis(std::uint32_t actions);

}  // namespace holdfast
