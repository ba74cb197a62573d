#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "drivers/can/can_frame.h"
#include "drivers/sensors/binary_sensors.h"
#include "drivers/sensors/modbus_line.h"
#include "drivers/sensors/periodic_group.h"

namespace holdfast {

/// Asks for discrete inputs whose addresses follow each other.
struct ModbusRequest {
  int first_input = 0;
  std::vector<std::size_t> places;  // of the unit's states, one for each input
};

/// A Modbus unit as a gateway knows it: what to ask it for, and the frame that tells its states.
/// Pure.
class ModbusUnit {
 public:
  /// Precondition: some sensor is of this unit.
  ModbusUnit(const BinarySensors& sensors, int unit);

  int unit() const { return unit_; }
  /// Asked in this order; addresses that no sensor has are not asked for.
  const std::vector<ModbusRequest>& requests() const { return requests_; }

  /// Takes what came of a request: inputs when they came, in the order of its places; not available
  /// when nobody spoke, faulty for all else.
  void take(const ModbusRequest& request, ModbusAnswer answer,
            std::span<const std::uint8_t> inputs);
  /// Appends the frame of its states.
  void tell(std::vector<CanFrame>& frames) const { group_.encode(states_, frames); }

 private:
  int unit_;
  PeriodicGroup group_;
  std::vector<ModbusRequest> requests_;
  std::vector<std::uint8_t> states_;
};

/// All units that sensors are of, in the order of their first sensors.
std::vector<ModbusUnit> modbus_units(const BinarySensors& sensors);

/// A simulated Modbus unit: it answers what the frames of a simulated gateway tell. Pure.
class ModbusTwin {
 public:
  /// is_in_step: each round of requests gets the next step, the first one step 1, however early or
  /// late it comes; otherwise the latest.
  ModbusTwin(const BinarySensors& sensors, int unit, bool is_in_step);

  int first_input() const { return first_input_; }
  /// Takes a frame of the sensor-side bus, and the end of a step. A step without a frame of this
  /// unit, or with a state that is neither 0 nor 1, is one in which it is silent.
  void on_frame(const CanFrame& frame);
  void end_step();

  enum class Reply { kAnswer, kSilent, kNotYet };
  /// What to do about a request; kNotYet: ask again after the next step.
  Reply on_request(int first_asked);
  /// From first_input on, each 0 or 1; valid after kAnswer.
  std::span<const std::uint8_t> inputs() const { return inputs_; }
  /// Steps that nobody asked for until too many waited.
  std::int64_t num_forgotten() const { return num_forgotten_; }

 private:
  struct Snapshot {
    bool is_told = false;
    std::uint32_t states = 0;  // bit i: place i
  };

  ModbusUnit unit_;
  PeriodicGroup group_;
  bool is_in_step_;
  std::vector<int> addresses_;  // by place
  int first_input_ = 0;
  std::int64_t step_ = 1;
  Snapshot filling_, shown_;
  std::deque<Snapshot> waiting_;
  std::vector<std::uint8_t> inputs_;
  std::int64_t num_forgotten_ = 0;
};

}  // namespace holdfast
