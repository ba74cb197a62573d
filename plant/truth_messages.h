#pragma once

#include <cstdint>

#include "plant/plant.h"

namespace holdfast {

class truth_t;
class attack_signal_t;
class known_input_t;

/// Fills the message but for seq; utime is the time of validity of the step in microseconds.
void to_message(const PlantStep& step, std::int64_t utime, truth_t& message);
void to_message(const AttackSignal& signal, std::int64_t step, std::int64_t utime,
                attack_signal_t& message);

/// Fills the message but for seq; false, and nothing done, for a plant without known inputs.
bool to_message(const Eigen::VectorXd& input, std::int64_t step, std::int64_t utime,
                known_input_t& message);

}  // namespace holdfast
