#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "drivers/can/can_frame.h"

namespace holdfast::testing {

/// A frame of any kind, valid or not.
inline CanFrame frame_of(std::uint32_t identifier, std::uint8_t flags,
                         const std::vector<std::uint8_t>& bytes) {
  CanFrame frame;
  frame.identifier = identifier;
  frame.flags = flags;
  frame.num_bytes = static_cast<std::uint8_t>(bytes.size());
  std::copy(bytes.begin(), bytes.end(), frame.data.begin());
  return frame;
}

}  // namespace holdfast::testing
