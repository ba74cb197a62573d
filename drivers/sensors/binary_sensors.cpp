#include "drivers/sensors/binary_sensors.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <set>
#include <utility>

namespace holdfast {
namespace {

constexpr std::uint32_t kGroupMost = 0x3FFFF, kBroadcastFormat = 240;
constexpr std::uint32_t kSwitchBank = 127501;
constexpr std::uint32_t kPriority = 6, kSwitchBankPriority = 3;

void read_canopen(ConfigurationMap map, BinarySensor& sensor) {
  sensor.protocol = BinarySensor::Protocol::kCanopen;
  map.require("node");
  map.read("node", sensor.node, {1.0, 127.0});
  map.require("input");
  map.read("input", sensor.input, {1.0, 64.0});
  sensor.name = "node " + std::to_string(sensor.node) + " input " + std::to_string(sensor.input);
}

void read_j1939(ConfigurationMap map, BinarySensor& sensor) {
  sensor.protocol = BinarySensor::Protocol::kJ1939;
  std::int64_t group = 0;
  map.require("pgn");
  map.read("pgn", group, {0.0, static_cast<double>(kGroupMost)});
  sensor.group_number = static_cast<std::uint32_t>(group);
  if ((sensor.group_number >> 8 & 0xFFU) < kBroadcastFormat && (sensor.group_number & 0xFFU) != 0)
    map.problem("pgn", "a group that is sent to one address ends in 00");
  map.require("source");
  map.read("source", sensor.source_address, {0.0, 253.0});
  // Left out it stays so in what is resolved: there is no number for "anything".
  if (map.has("instance")) map.read("instance", sensor.instance, {0.0, 255.0});
  if (map.has("item") == map.has("start_bit")) {
    map.problem("item", "give item (of 127501, from 1) or start_bit");
    map.raw("item");
    map.raw("start_bit");
  } else if (map.has("item")) {
    int item = 1;
    map.read("item", item, {1.0, 28.0});
    if (sensor.group_number != kSwitchBank)
      map.problem("item", "only the items of 127501 have numbers; give start_bit");
    sensor.start_bit = 8 + 2 * (item - 1);
  } else {
    map.read("start_bit", sensor.start_bit, {0.0, 62.0});
  }
  if (sensor.instance >= 0 && sensor.start_bit < 8)
    map.problem("instance", "is byte 0, where the state stands already");
  sensor.name = "group " + std::to_string(sensor.group_number) + " of " +
                std::to_string(sensor.source_address) +
                (sensor.instance < 0 ? "" : " instance " + std::to_string(sensor.instance)) +
                " bit " + std::to_string(sensor.start_bit);
}

void read_modbus(ConfigurationMap map, BinarySensor& sensor) {
  sensor.protocol = BinarySensor::Protocol::kModbus;
  map.require("unit");
  map.read("unit", sensor.unit, {1.0, 247.0});
  map.require("input");
  map.read("input", sensor.address, {0.0, 65535.0});
  sensor.name = "unit " + std::to_string(sensor.unit) + " input " + std::to_string(sensor.address);
}

void read_dbc(ConfigurationMap map, const Dbc& dbc, BinarySensor& sensor) {
  map.require("message");
  map.read("message", sensor.message);
  map.require("signal");
  map.read("signal", sensor.signal);
  sensor.name = sensor.message + "." + sensor.signal;
  const DbcMessage* message = dbc.find(sensor.message);
  const DbcSignal* signal = message == nullptr ? nullptr : message->find(sensor.signal);
  if (message == nullptr) {
    if (map.has("message"))
      map.problem("message", "'" + sensor.message + "' is no message of the DBC");
  } else if (signal == nullptr) {
    map.problem("signal", "message '" + sensor.message + "' has no signal '" + sensor.signal + "'");
  } else if (signal->kind != DbcSignal::Kind::kUnsigned) {
    map.problem("signal", "'" + sensor.signal + "' must be unsigned to be 0 or 1");
  } else if (!message->frame_for({*signal})) {
    map.problem("signal", "no frame of message '" + sensor.message + "' carries '" + sensor.signal +
                              "': its selector cannot say so");
  }
}

BinarySensor read_sensor(ConfigurationMap& map, const Dbc& dbc) {
  BinarySensor sensor;
  constexpr std::array kProtocols = {"canopen", "j1939", "dbc", "modbus"};
  if (std::ranges::count_if(kProtocols, [&](const char* key) { return map.has(key); }) != 1) {
    map.problem("canopen", "a sensor has one of: canopen, j1939, dbc, modbus");
    for (const char* key : kProtocols) map.raw(key);
  } else if (map.has("canopen")) {
    read_canopen(map.map("canopen"), sensor);
  } else if (map.has("j1939")) {
    read_j1939(map.map("j1939"), sensor);
  } else if (map.has("modbus")) {
    read_modbus(map.map("modbus"), sensor);
  } else {
    read_dbc(map.map("dbc"), dbc, sensor);
  }
  map.read("invert", sensor.is_inverted);
  map.read("name", sensor.name);
  return sensor;
}

// Which frames a sensor's state stands in, and in which of their bits.
struct Spot {
  bool is_nowhere = true;  // since what it names does not exist
  std::uint32_t key = 0;   // of a group without priority and destination; bit 30 tells those apart
  int instance = -1;
  const DbcSignal* signal = nullptr;  // of a DBC
  std::array<std::uint8_t, CanFrame::kBytesMax> bits{};
};

constexpr std::uint32_t kInputsPdo = 0x180, kWide = 1U << 29, kGroup = 1U << 30;

// Of an identifier as it stands in a DBC: one of 29 bits is a parameter group, too.
std::uint32_t key_of(std::uint32_t identifier, bool is_extended) {
  if (!is_extended) return identifier;
  return kWide | kGroup | j1939_group_number(identifier) << 8 | (identifier & 0xFFU);
}

Spot spot_of(const BinarySensor& sensor, const Dbc& dbc) {
  Spot spot;
  DbcSignal signal;
  switch (sensor.protocol) {
    case BinarySensor::Protocol::kCanopen:
      spot.key = kInputsPdo + static_cast<std::uint32_t>(sensor.node);
      signal.start_bit = sensor.input - 1;
      break;
    case BinarySensor::Protocol::kJ1939:
      spot.key = key_of(j1939_identifier(sensor.group_number, sensor.source_address), true);
      spot.instance = sensor.instance;
      signal.start_bit = sensor.start_bit;
      signal.num_bits = 2;
      break;
    case BinarySensor::Protocol::kModbus:
      if (sensor.identifier == 0) return spot;
      spot.key = sensor.identifier;
      signal.start_bit = sensor.start_bit;
      signal.num_bits = 2;
      break;
    case BinarySensor::Protocol::kDbc: {
      const DbcMessage* message = dbc.find(sensor.message);
      spot.signal = message == nullptr ? nullptr : message->find(sensor.signal);
      if (spot.signal == nullptr) return spot;
      spot.key = key_of(message->identifier, message->is_extended);
      signal = *spot.signal;
      break;
    }
  }
  spot.is_nowhere = false;
  signal.set_raw(spot.bits, UINT64_MAX);
  return spot;
}

// True for an identifier that a CANopen node sends with, or is told things by.
bool is_of_node(const BinarySensor& sensor, std::uint32_t key) {
  if (sensor.protocol != BinarySensor::Protocol::kCanopen) return false;
  const auto node = static_cast<std::uint32_t>(sensor.node);
  return key == 0 || key == 0x080 + node || key == kInputsPdo + node || key == 0x700 + node;
}

// Why two cannot stand side by side; empty when they can.
std::string conflict_of(const BinarySensor& a, const BinarySensor& b, const Dbc& dbc) {
  const auto is_unit = [](const BinarySensor& sensor) {
    return sensor.protocol == BinarySensor::Protocol::kModbus;
  };
  if (is_unit(a) && is_unit(b) && a.unit == b.unit && a.address == b.address)
    return "reads the input of another sensor";
  const Spot one = spot_of(a, dbc), other = spot_of(b, dbc);
  const bool is_in_both =
      one.key == other.key || is_of_node(a, other.key) || is_of_node(b, one.key);
  if (one.is_nowhere || other.is_nowhere || !is_in_both) return "";
  if (a.protocol != b.protocol) return "stands in a frame of another protocol's sensor";
  if (one.key != other.key) return "";
  if ((one.instance < 0) != (other.instance < 0))
    return "stands in the frames of a sensor that says its instance: say it for both";
  if (one.instance != other.instance) return "";
  bool shares_bits = false;
  for (std::size_t i = 0; i < one.bits.size(); ++i)
    shares_bits = shares_bits || (one.bits[i] & other.bits[i]) != 0;
  if (!shares_bits) return "";
  // Signals that no frame carries together may.
  if (one.signal != nullptr && a.message == b.message &&
      !dbc.find(a.message)->frame_for({*one.signal, *other.signal}))
    return "";
  return "shares bits with another sensor";
}

// Where a gateway's frame holds the state: behind those of the unit's sensors before it.
void place_in_frame(const BinarySensors& sensors, ConfigurationMap& entry, BinarySensor& sensor) {
  constexpr std::int64_t kStatesMost = 32;
  if (sensor.protocol != BinarySensor::Protocol::kModbus) return;
  const auto num_before = std::ranges::count_if(sensors.list, [&](const BinarySensor& other) {
    return other.protocol == sensor.protocol && other.unit == sensor.unit;
  });
  if (num_before >= kStatesMost)
    return entry.problem("modbus", "a unit has at most 32 sensors, which one frame can tell");
  sensor.start_bit = static_cast<int>(2 * num_before);
  sensor.identifier = static_cast<std::uint32_t>(sensors.modbus_identifier + sensor.unit);
}

}  // namespace

bool BinarySensors::have_units() const {
  return std::ranges::any_of(list, [](const BinarySensor& sensor) {
    return sensor.protocol == BinarySensor::Protocol::kModbus;
  });
}

bool BinarySensors::have_way_back() const {
  const bool has_nodes = std::ranges::any_of(list, [](const BinarySensor& sensor) {
    return sensor.protocol == BinarySensor::Protocol::kCanopen;
  });
  return has_nodes && (starts_nodes || guards_nodes);
}

void BinarySensors::read(ConfigurationMap& map, const Dbc& dbc) {
  std::set<std::string> names;
  ConfigurationMap options = map.map("sensor_options");
  options.read("modbus_identifier", modbus_identifier, {0.0, 0x7FF - 247});
  options.read("modbus_timeout_s", modbus_timeout_s, {0.001, 60.0});
  for (ConfigurationMap& entry : map.maps("sensors")) {
    BinarySensor sensor = read_sensor(entry, dbc);
    place_in_frame(*this, entry, sensor);
    if (!sensor.name.empty() && !names.insert(sensor.name).second)
      entry.problem("name", "'" + sensor.name + "' is taken");
    for (const BinarySensor& other : list) {
      const std::string conflict = conflict_of(sensor, other, dbc);
      if (conflict.empty()) continue;
      entry.problem("name", "'" + sensor.name + "' " + conflict + " ('" + other.name + "')");
      break;
    }
    list.push_back(std::move(sensor));
  }
  if (list.empty()) map.problem("sensors", "at least one sensor is needed");
  options.read("timeout_steps", timeout_steps, {1.0, 1e6});
  options.read("starts_nodes", starts_nodes);
  options.read("guards_nodes", guards_nodes);
  options.read("heeds_emergencies", heeds_emergencies);
  options.read("nodes_start_themselves", nodes_start_themselves);
  options.read("heartbeat_steps", heartbeat_steps, {0.0, 1e6});
  options.read("repeat_steps", repeat_steps, {1.0, 1e6});
  const bool has_nodes = std::ranges::any_of(list, [](const BinarySensor& sensor) {
    return sensor.protocol == BinarySensor::Protocol::kCanopen;
  });
  if (has_nodes && heartbeat_steps >= timeout_steps + 1)
    options.problem("heartbeat_steps", "is longer than timeout_steps: every node would be silent");
  if (has_nodes && heartbeat_steps == 0 && !guards_nodes)
    options.problem("heartbeat_steps", "0 leaves no sign of life unless guards_nodes is true");
  for (ConfigurationMap& entry : options.maps("outages")) {
    SensorOutage outage;
    entry.require("sensor");
    entry.read("sensor", outage.sensor);
    if (entry.has("sensor") && !names.contains(outage.sensor))
      entry.problem("sensor", "no sensor is named '" + outage.sensor + "'");
    entry.read("first_step", outage.first_step, {1.0, 1e9});
    outage.last_step = outage.first_step;
    entry.read("last_step", outage.last_step, {1.0, 1e9});
    if (outage.last_step < outage.first_step) entry.problem("last_step", "lies before first_step");
    outages.push_back(outage);
  }
}

std::string sensor_on(const BinarySensors& sensors, const Dbc& dbc, const DbcMessage& message) {
  for (const BinarySensor& sensor : sensors.list) {
    const std::uint32_t key = key_of(message.identifier, message.is_extended);
    const Spot spot = spot_of(sensor, dbc);
    if (is_of_node(sensor, key) || (!spot.is_nowhere && key == spot.key)) return sensor.name;
  }
  return "";
}

std::uint32_t j1939_identifier(std::uint32_t group_number, int source_address) {
  const std::uint32_t priority = group_number == kSwitchBank ? kSwitchBankPriority : kPriority;
  const bool is_to_one = (group_number >> 8 & 0xFFU) < kBroadcastFormat;
  const std::uint32_t destination = is_to_one ? 0xFFU : 0U;
  return priority << 26 | (group_number | destination) << 8 |
         static_cast<std::uint32_t>(source_address);
}

std::uint32_t j1939_group_number(std::uint32_t identifier) {
  const std::uint32_t group = identifier >> 8 & kGroupMost;
  return (group >> 8 & 0xFFU) < kBroadcastFormat ? group & 0x3FF00U : group;
}

}  // namespace holdfast
