#pragma once

#include <cstdint>
#include <vector>

#include "common/measurement_set.h"
#include "drivers/sensors/canopen_node.h"
#include "drivers/sensors/periodic_group.h"

namespace holdfast {

/// What is known of binary sensors that keep their state, step by step. Pure; allocates nothing
/// once its lists have grown.
class SensorStates {
 public:
  /// Precondition: the sensors were read without problems, by this DBC.
  SensorStates(const BinarySensors& sensors, const Dbc& dbc);

  enum class Taken { kUnknown, kWrongFormat, kTaken };
  /// rx_index: nth frame that the driver read.
  Taken on_frame(const CanFrame& frame, std::int64_t rx_index, std::int64_t step);
  /// Adds to the set one packet for each sensor whose state is known, in their order, and the
  /// others to its invalid ones. A packet has the index of the frame that told of it last.
  void sample(std::int64_t step, MeasurementSet& set) const;
  /// Appends what nodes are to be told or asked after this step.
  void ask(std::int64_t step, std::vector<CanFrame>& frames) const;

 private:
  // Where a sensor's state is kept: in a node or a group.
  struct Place {
    bool is_node = false;
    std::size_t index = 0, place = 0;
  };
  struct Heard {
    std::int64_t rx_index = -1, receive_utime = 0;
  };

  BinarySensors sensors_;
  std::vector<Place> places_;
  std::vector<CanopenRemote> nodes_;
  std::vector<PeriodicGroup> groups_;
  std::vector<Heard> node_heard_, group_heard_;
};

/// Simulated binary sensors: what they send when they see these bits. Pure.
class SensorTwins {
 public:
  SensorTwins(const BinarySensors& sensors, const Dbc& dbc);

  /// Appends the frames of a step, devices in the order of their first sensors. readings[i]: of
  /// sensor i, one value, 0 or not.
  void step(std::int64_t step, const std::vector<std::vector<double>>& readings,
            std::vector<CanFrame>& frames);
  /// Takes what somebody tells the sensors.
  void on_frame(const CanFrame& frame);

 private:
  struct Device {
    std::vector<std::size_t> sensors;
    std::vector<std::size_t> inputs;  // CANopen: bit of each sensor
    int node = -1;                    // index into nodes_, else of a group
    std::size_t group = 0;
    std::vector<SensorOutage> outages;

    bool is_silent(std::int64_t step) const;
  };

  BinarySensors sensors_;
  std::vector<Device> devices_;
  std::vector<CanopenDevice> nodes_;
  std::vector<PeriodicGroup> groups_;
  std::vector<std::uint8_t> states_;
};

/// True for a frame that goes from a driver to such sensors.
bool is_for_sensors(const BinarySensors& sensors, const CanFrame& frame);

}  // namespace holdfast
