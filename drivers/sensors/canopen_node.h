#pragma once

#include <cstdint>
#include <initializer_list>
#include <vector>

#include "common/measurement_set.h"
#include "drivers/can/can_frame.h"
#include "drivers/sensors/binary_sensors.h"

namespace holdfast {

/// States of a CANopen node, as heartbeats tell them (CiA 301).
enum class CanopenState : std::uint8_t {
  kBootUp = 0x00,
  kStopped = 0x04,
  kOperational = 0x05,
  kPreOperational = 0x7F
};

/// A classic data frame with these bytes, at most 8.
CanFrame canopen_frame(std::uint32_t identifier, std::initializer_list<std::uint8_t> bytes);

/// What is known of a node with digital inputs (CiA 401), from its heartbeats, its first TPDO, its
/// emergencies and its answers to node guarding. Pure.
class CanopenRemote {
 public:
  /// timeout_steps: silence after which what it said before says nothing any more.
  explicit CanopenRemote(int node, std::int64_t timeout_steps = BinarySensors().timeout_steps)
      : node_(static_cast<std::uint32_t>(node)), timeout_steps_(timeout_steps) {}

  int node() const { return static_cast<int>(node_); }
  /// True for a frame that this node sends.
  bool sends(const CanFrame& frame) const;
  /// Takes such a frame; false when its length or form is none that such a frame has.
  bool on_frame(const CanFrame& frame, std::int64_t step);
  /// True for a frame that tells its inputs.
  bool tells_inputs(const CanFrame& frame) const;
  /// Whether an input, 1 to 64, is known in this step, and why not.
  InvalidReason reason(int input, std::int64_t step, bool heeds_emergencies) const;
  /// Input i is bit i - 1.
  std::uint64_t inputs() const { return inputs_; }
  /// True when it is heard, and not operational.
  bool wants_start(std::int64_t step) const {
    return is_heard(step) && state_ != CanopenState::kOperational;
  }
  CanFrame start_command() const {
    return canopen_frame(0x000, {0x01, static_cast<std::uint8_t>(node_)});
  }
  CanFrame guard_request() const;

 private:
  bool is_heard(std::int64_t step) const {
    return last_life_step_ > 0 && step - last_life_step_ < timeout_steps_;
  }
  bool take_state(std::uint8_t byte, std::int64_t step);

  std::uint32_t node_;
  std::int64_t timeout_steps_;
  CanopenState state_ = CanopenState::kBootUp;
  std::int64_t last_life_step_ = 0;  // 0: never
  int num_inputs_ = 0;               // that its latest TPDO told
  std::uint64_t inputs_ = 0;
  std::uint16_t emergency_ = 0;
};

/// A simulated node with digital inputs.
class CanopenDevice {
 public:
  /// num_inputs: 1..64.
  CanopenDevice(int node, int num_inputs, const BinarySensors& options);

  /// Appends what the node sends in a step in which its inputs are these. is_silent: it is pulled
  /// out; when it is back, it boots anew.
  void step(std::uint64_t inputs, bool is_silent, std::vector<CanFrame>& frames);
  /// Network management and node guarding, taken before the next step.
  void on_frame(const CanFrame& frame);
  CanopenState state() const { return state_; }

 private:
  void boot(std::vector<CanFrame>& frames);

  std::uint32_t node_;
  std::uint8_t num_bytes_;
  std::int64_t heartbeat_steps_, repeat_steps_;
  bool starts_itself_;
  CanopenState state_ = CanopenState::kBootUp;
  bool is_on_ = false, is_asked_ = false, toggle_ = false, must_tell_ = false;
  std::uint64_t inputs_ = 0;
  std::int64_t since_told_ = 0, since_heartbeat_ = 0;
};

}  // namespace holdfast
