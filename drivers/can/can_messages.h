#pragma once

#include <cstdint>

#include "drivers/can/can_frame.h"

namespace holdfast {

class can_frame_t;

/// Fills the message; index is the frame's place among those of its bus and direction, from 0.
/// The receive stamp is rounded down to microseconds.
void to_message(const CanFrame& frame, std::int64_t index, can_frame_t& message);

/// Fills the frame; false (and an unspecified frame) when the message holds none that is_valid().
bool from_message(const can_frame_t& message, CanFrame& frame);

}  // namespace holdfast
