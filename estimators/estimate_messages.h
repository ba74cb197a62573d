#pragma once

#include "estimators/estimate.h"

namespace holdfast {

class estimate_t;

/// Fills the message (seq stays: the link counts it); covariances row by row. Keeps the message's
/// memory where it can.
void to_message(const Estimate& estimate, estimate_t& message);

/// Fills the estimate from a message that passed the guard. Throws std::invalid_argument when the
/// lengths do not fit together (a covariance that is not n x n, an unknown outcome).
void from_message(const estimate_t& message, Estimate& estimate);

}  // namespace holdfast
