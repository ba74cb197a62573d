#include "drivers/sensors/canopen_node.h"

#include <algorithm>

namespace holdfast {
namespace {

constexpr std::uint32_t kManagement = 0x000, kEmergency = 0x080, kFirstPdo = 0x180,
                        kHeartbeat = 0x700;
constexpr std::uint8_t kStart = 0x01, kStop = 0x02, kEnterPreOperational = 0x80, kResetNode = 0x81,
                       kResetCommunication = 0x82;
constexpr std::uint8_t kToggle = 0x80;

}  // namespace

CanFrame canopen_frame(std::uint32_t identifier, std::initializer_list<std::uint8_t> bytes) {
  CanFrame frame;
  frame.identifier = identifier;
  frame.num_bytes = static_cast<std::uint8_t>(bytes.size());
  std::copy(bytes.begin(), bytes.end(), frame.data.begin());
  return frame;
}

bool CanopenRemote::sends(const CanFrame& frame) const {
  if (frame.has(CanFrame::kExtended) || frame.has(CanFrame::kRemote)) return false;
  return frame.identifier == kHeartbeat + node_ || frame.identifier == kFirstPdo + node_ ||
         frame.identifier == kEmergency + node_;
}

bool CanopenRemote::take_state(std::uint8_t byte, std::int64_t step) {
  // Boot-up has no toggle bit.
  const auto state = byte == 0
                         ? CanopenState::kBootUp
                         : static_cast<CanopenState>(static_cast<std::uint8_t>(byte & ~kToggle));
  const bool is_known = byte == 0 || state == CanopenState::kStopped ||
                        state == CanopenState::kOperational ||
                        state == CanopenState::kPreOperational;
  if (!is_known) return false;
  // Missing at the end of the step before.
  const bool was_missing = !is_heard(step - 1);
  if (was_missing || state == CanopenState::kBootUp) emergency_ = 0;
  // What it said of its inputs before it left, or fell silent, is not what they are now.
  if (was_missing || state != CanopenState::kOperational) num_inputs_ = 0;
  last_life_step_ = step;
  state_ = state == CanopenState::kBootUp ? CanopenState::kPreOperational : state;
  return true;
}

bool CanopenRemote::tells_inputs(const CanFrame& frame) const {
  return frame.identifier == kFirstPdo + node_;
}

bool CanopenRemote::on_frame(const CanFrame& frame, std::int64_t step) {
  if (frame.has(CanFrame::kFd)) return false;
  if (frame.identifier == kHeartbeat + node_)
    return frame.num_bytes == 1 && take_state(frame.data[0], step);
  if (frame.identifier == kEmergency + node_) {
    if (frame.num_bytes != 8) return false;
    emergency_ = static_cast<std::uint16_t>(frame.data[0] | frame.data[1] << 8);
    return true;
  }
  if (frame.num_bytes == 0) return false;
  inputs_ = 0;
  for (std::size_t i = 0; i < frame.num_bytes; ++i)
    inputs_ |= static_cast<std::uint64_t>(frame.data[i]) << (8 * i);
  num_inputs_ = 8 * frame.num_bytes;
  return true;
}

InvalidReason CanopenRemote::reason(int input, std::int64_t step, bool heeds_emergencies) const {
  if (last_life_step_ == 0) return InvalidReason::kNeverHeard;
  if (!is_heard(step)) return InvalidReason::kSilent;
  if (state_ != CanopenState::kOperational) return InvalidReason::kNotOperational;
  if (heeds_emergencies && emergency_ != 0) return InvalidReason::kError;
  return input <= num_inputs_ ? InvalidReason::kNone : InvalidReason::kNotAvailable;
}

CanFrame CanopenRemote::guard_request() const {
  CanFrame frame = canopen_frame(kHeartbeat + node_, {0});
  frame.flags |= CanFrame::kRemote;
  return frame;
}

CanopenDevice::CanopenDevice(int node, int num_inputs, const BinarySensors& options)
    : node_(static_cast<std::uint32_t>(node)),
      num_bytes_(static_cast<std::uint8_t>((num_inputs + 7) / 8)),
      heartbeat_steps_(options.heartbeat_steps),
      repeat_steps_(options.repeat_steps),
      starts_itself_(options.nodes_start_themselves) {}

void CanopenDevice::boot(std::vector<CanFrame>& frames) {
  frames.push_back(
      canopen_frame(kHeartbeat + node_, {static_cast<std::uint8_t>(CanopenState::kBootUp)}));
  state_ = starts_itself_ ? CanopenState::kOperational : CanopenState::kPreOperational;
  is_on_ = must_tell_ = true;
  is_asked_ = toggle_ = false;
  since_heartbeat_ = heartbeat_steps_;
}

void CanopenDevice::step(std::uint64_t inputs, bool is_silent, std::vector<CanFrame>& frames) {
  if (is_silent) {
    is_on_ = false;
    return;
  }
  if (!is_on_) boot(frames);
  const auto life = [&](std::uint8_t toggle) {
    frames.push_back(
        canopen_frame(kHeartbeat + node_,
                      {static_cast<std::uint8_t>(static_cast<std::uint8_t>(state_) | toggle)}));
  };
  // Its state first, so that who hears of inputs knows that it measures.
  if (heartbeat_steps_ > 0 && since_heartbeat_++ >= heartbeat_steps_ - 1) {
    life(0);
    since_heartbeat_ = 0;
  }
  if (is_asked_) {
    life(toggle_ ? kToggle : 0);
    toggle_ = !toggle_;
    is_asked_ = false;
  }
  if (state_ != CanopenState::kOperational) return;
  if (!must_tell_ && inputs == inputs_ && ++since_told_ < repeat_steps_) return;
  CanFrame& told = frames.emplace_back(canopen_frame(kFirstPdo + node_, {}));
  told.num_bytes = num_bytes_;
  for (std::size_t i = 0; i < num_bytes_; ++i)
    told.data[i] = static_cast<std::uint8_t>(inputs >> (8 * i));
  inputs_ = inputs;
  must_tell_ = false;
  since_told_ = 0;
}

void CanopenDevice::on_frame(const CanFrame& frame) {
  if (!is_on_ || frame.has(CanFrame::kExtended) || frame.has(CanFrame::kFd)) return;
  if (frame.has(CanFrame::kRemote)) {
    is_asked_ = is_asked_ || frame.identifier == kHeartbeat + node_;
    return;
  }
  if (frame.identifier != kManagement || frame.num_bytes != 2) return;
  if (frame.data[1] != 0 && frame.data[1] != node_) return;
  switch (frame.data[0]) {
    case kStart:
      must_tell_ = must_tell_ || state_ != CanopenState::kOperational;
      state_ = CanopenState::kOperational;
      break;
    case kStop:
      state_ = CanopenState::kStopped;
      break;
    case kEnterPreOperational:
      state_ = CanopenState::kPreOperational;
      break;
    case kResetNode:
    case kResetCommunication:
      is_on_ = false;
      break;
    default:
      break;
  }
}

}  // namespace holdfast
