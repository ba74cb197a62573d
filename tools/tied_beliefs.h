#pragma once

#include <string>

#include "tools/estimator_methods.h"

namespace holdfast {

/// The attack that an estimator for binary sensors assumes: keys dos, deception, flip (numbers, or
/// "same" as the plant's attack and the flip rules) and deception_range.
BinaryTargetModel::Attack read_assumed_attack(ConfigurationMap map,
                                              const BinaryTargetModel::Attack& truth,
                                              const MethodContext& context);

/// A believed probability that "same" ties to the true one, so that a sweep moves both. Reports
/// "same" where a rule acts only at times, which is no one number.
void read_tied_probability(ConfigurationMap& map, const char* key, double& value, double truth,
                           const std::string& untied_rule);

/// Probability that no rule of this action, acting on whole frames in every step, touches a frame
/// of the layout's messages; the name of a rule that acts only at times or on some, if any.
double untouched_probability(const MethodContext& context, AttackRule::Action action,
                             std::string& untied_rule);

}  // namespace holdfast
