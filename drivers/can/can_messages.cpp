#include "drivers/can/can_messages.h"

#include <holdfast/can_frame_t.hpp>

namespace holdfast {

static_assert(int{CanFrame::kExtended} == can_frame_t::EXTENDED &&
              int{CanFrame::kRemote} == can_frame_t::REMOTE &&
              int{CanFrame::kError} == can_frame_t::ERROR &&
              int{CanFrame::kFd} == can_frame_t::FD &&
              int{CanFrame::kBitRateSwitch} == can_frame_t::BIT_RATE_SWITCH &&
              int{CanFrame::kErrorStateIndicator} == can_frame_t::ERROR_STATE_INDICATOR);

void to_message(const CanFrame& frame, std::int64_t index, can_frame_t& message) {
  message.index = index;
  message.receive_utime = frame.receive_time_ns / 1000;
  message.identifier = static_cast<std::int32_t>(frame.identifier);
  message.flags = frame.flags;
  // A remote frame's length is its request; it stands in the message with that many zero bytes.
  message.num_bytes = frame.num_bytes;
  message.data.assign(frame.num_bytes, 0);
  std::copy(frame.bytes().begin(), frame.bytes().end(), message.data.begin());
}

bool from_message(const can_frame_t& message, CanFrame& frame) {
  constexpr std::int32_t kAllFlags = 63;
  if (message.identifier < 0 || message.flags < 0 || message.flags > kAllFlags) return false;
  if (message.num_bytes < 0 || message.num_bytes > static_cast<std::int32_t>(CanFrame::kBytesMax) ||
      message.data.size() != static_cast<std::size_t>(message.num_bytes)) {
    return false;
  }
  frame = CanFrame{};
  frame.identifier = static_cast<std::uint32_t>(message.identifier);
  frame.flags = static_cast<std::uint8_t>(message.flags);
  frame.num_bytes = static_cast<std::uint8_t>(message.num_bytes);
  frame.receive_time_ns = message.receive_utime * 1000;
  if (!frame.has(CanFrame::kRemote)) {
    std::copy(message.data.begin(), message.data.end(), frame.data.begin());
  }
  return is_valid(frame);
}

}  // namespace holdfast
