#pragma once

#include "common/measurement_set.h"

namespace holdfast {

class measurement_set_t;

/// Fills the message (seq stays: the link counts it). Keeps the message's memory where it can.
void to_message(const MeasurementSet& set, measurement_set_t& message);

/// Fills the set from a message that passed the guard.
void from_message(const measurement_set_t& message, MeasurementSet& set);

}  // namespace holdfast
