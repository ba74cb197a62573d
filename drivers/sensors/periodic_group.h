#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/measurement_set.h"
#include "drivers/can/can_frame.h"
#include "drivers/can/dbc.h"
#include "drivers/sensors/binary_sensors.h"

namespace holdfast {

/// A frame that tells the states of some sensors again and again: a J1939 or NMEA 2000 parameter
/// group with two-bit states (0, 1, 2: error, 3: not available), a gateway's frame of a Modbus unit
/// with such states, or a message of a DBC file, whose one-bit signals say 0 or 1 and whose wider
/// ones also 2 or more: error, all ones: not available. Both ends of it. Pure.
class PeriodicGroup {
 public:
  static constexpr std::uint8_t kError = 2, kNotAvailable = 3;

  /// Precondition: the sensor is of J1939 or Modbus, or its message and signal are in the DBC.
  /// timeout_steps: silence after which what it said before says nothing any more.
  PeriodicGroup(const BinarySensor& first, const Dbc& dbc,
                std::int64_t timeout_steps = BinarySensors().timeout_steps);

  /// True for a sensor that stands in the same frame.
  bool holds(const BinarySensor& sensor) const;
  /// Its place among the group's states.
  std::size_t add(const BinarySensor& sensor);

  bool is_one(const CanFrame& frame) const;
  /// Takes such a frame; false when it is too short for all of the states, or not of the message's
  /// form.
  bool on_frame(const CanFrame& frame, std::int64_t step);
  InvalidReason reason(std::size_t place, std::int64_t step) const;
  bool state(std::size_t place) const { return states_[place].raw == 1; }

  /// Appends the frames that say these states (0, 1, of two bits also kError, kNotAvailable), all
  /// else not available (J1939, Modbus) or zero (DBC): one, or of a multiplexed message one for
  /// all values of its selectors that some state needs.
  void encode(std::span<const std::uint8_t> states, std::vector<CanFrame>& frames) const;

 private:
  struct State {
    DbcSignal signal;
    std::uint64_t raw = 0;
    bool is_told = false;
  };

  BinarySensor first_;
  DbcMessage message_;
  std::vector<State> states_;
  CanFrame empty_;                    // that says nothing
  std::vector<CanFrame> selections_;  // the same, with selectors set as some state needs them
  std::int64_t timeout_steps_;
  std::int64_t last_step_ = 0;  // 0: never heard
};

}  // namespace holdfast
