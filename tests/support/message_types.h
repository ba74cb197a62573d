#pragma once

#include <holdfast/layouts.h>

#include <cstdint>
#include <holdfast/attack_frame_t.hpp>
#include <holdfast/attack_signal_t.hpp>
#include <holdfast/can_frames_t.hpp>
#include <holdfast/estimate_t.hpp>
#include <holdfast/known_input_t.hpp>
#include <holdfast/measurement_set_t.hpp>
#include <holdfast/run_meta_t.hpp>
#include <holdfast/status_t.hpp>
#include <holdfast/timing_t.hpp>
#include <holdfast/truth_t.hpp>
#include <string>
#include <vector>

namespace holdfast::testing {

/// Calls action.operator()<Message>() for each type of lcmtypes/, in the order of their names.
template <class Action>
void for_each_message_type(Action&& action) {
  action.template operator()<attack_frame_t>();
  action.template operator()<attack_signal_t>();
  action.template operator()<can_frame_t>();
  action.template operator()<can_frames_t>();
  action.template operator()<estimate_t>();
  action.template operator()<hypothesis_t>();
  action.template operator()<known_input_t>();
  action.template operator()<measurement_set_t>();
  action.template operator()<packet_t>();
  action.template operator()<run_meta_t>();
  action.template operator()<status_t>();
  action.template operator()<timing_t>();
  action.template operator()<truth_t>();
}

template <class Message>
std::vector<std::uint8_t> encoded(const Message& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

}  // namespace holdfast::testing
