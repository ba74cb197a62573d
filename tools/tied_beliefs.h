#pragma once

#include <optional>

#include "tools/estimator_methods.h"

namespace holdfast {

/// The attack that an estimator for binary sensors assumes: keys dos, deception, flip (numbers, or
/// "same" as the plant's attack and the flip rules) and deception_range.
BinaryTargetModel::Attack read_assumed_attack(ConfigurationMap map,
                                              const BinaryTargetModel::Attack& truth,
                                              const MethodContext& context);

/// True probability for a key that says "same": that a frame is touched by a rule of this action,
/// or that it is not; a rule that forces values counts as one that substitutes them. None when the
/// key says something else. Reports "same" where no one number is true: a rule acts only at times,
/// on some of the messages, or where another rule did or did not.
std::optional<double> tied_probability(ConfigurationMap& map, const char* key,
                                       AttackRule::Action action, bool is_touched,
                                       const MethodContext& context);

/// Probability of the one rule of this action, for a key that says "same": where it may act, a rule
/// under conditions included. None when the key says something else; 0 without such
/// a rule. Reports "same" where there are several.
std::optional<double> probability_of_rule(ConfigurationMap& map, const char* key,
                                          AttackRule::Action action, const MethodContext& context);

}  // namespace holdfast
