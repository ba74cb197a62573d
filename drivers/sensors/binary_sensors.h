#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/configuration.h"
#include "drivers/can/dbc.h"

namespace holdfast {

/// Where the bit of one binary sensor stands on a bus that its makers laid out.
struct BinarySensor {
  enum class Protocol { kCanopen, kJ1939, kDbc, kModbus };

  std::string name;
  Protocol protocol = Protocol::kDbc;
  bool is_inverted = false;
  int node = 1, input = 1;  // CANopen: 1..127; 1..64, bit input - 1 of TPDO1
  // J1939 and NMEA 2000: a two-bit state that begins at this bit of the parameter group.
  std::uint32_t group_number = 0;
  int source_address = 0;       // 0..253
  int instance = -1;            // what byte 0 must hold; -1: anything
  int start_bit = 0;            // 0..62
  std::string message, signal;  // DBC
  // Modbus: 1..247, 0..65535. A gateway tells all states of a unit in one frame with this
  // identifier, two bits each, this one from start_bit on.
  int unit = 1, address = 0;
  std::uint32_t identifier = 0;
};

/// Steps in which what a sensor hangs on says nothing: pulled out, and put back.
struct SensorOutage {
  std::string sensor;
  std::int64_t first_step = 1, last_step = 1;
};

/// Binary sensors that keep their state until they tell of another one, in the place of a message
/// for each reading of each step.
struct BinarySensors {
  std::vector<BinarySensor> list;  // source i is list[i]
  std::int64_t timeout_steps = 3;  // a step is the first of so many without a sign of life: silent
  // CANopen, this side.
  bool starts_nodes = true;       // sends NMT start to nodes that are not operational
  bool guards_nodes = false;      // asks nodes for their state by remote frames, in each step
  bool heeds_emergencies = true;  // inputs of a node in emergency are invalid
  // Modbus, the gateway.
  std::int64_t modbus_identifier = 0x500;  // a unit's frame has this and its number
  double modbus_timeout_s = 0.1;           // that a unit may take for its answer
  // Simulated sensors.
  bool nodes_start_themselves = true;  // CANopen: operational after boot-up without being told
  std::int64_t heartbeat_steps = 1;    // CANopen: between heartbeats; 0: none, nodes are guarded
  std::int64_t repeat_steps = 10;      // CANopen: a state that does not change is sent again
  std::vector<SensorOutage> outages;

  bool exist() const { return !list.empty(); }
  bool have_units() const;  // of Modbus
  /// True when frames go from the driver to the sensors.
  bool have_way_back() const;

  /// Reads the keys sensors (a list) and sensor_options; reports what is wrong on the map. What a
  /// sensor of a DBC names must be in it.
  void read(ConfigurationMap& map, const Dbc& dbc);
};

/// Name of a sensor that sends, or is told things by, frames with the identifier of this message;
/// empty when there is none.
std::string sensor_on(const BinarySensors& sensors, const Dbc& dbc, const DbcMessage& message);

/// 29-bit identifier of a parameter group, sent to all.
std::uint32_t j1939_identifier(std::uint32_t group_number, int source_address);
/// The parameter group of a 29-bit identifier, destination left out.
std::uint32_t j1939_group_number(std::uint32_t identifier);

}  // namespace holdfast
