#include "drivers/sensors/binary_sensors.h"

#include <algorithm>
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
  map.read("instance", sensor.instance, {0.0, 255.0});
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
  }
}

BinarySensor read_sensor(ConfigurationMap& map, const Dbc& dbc) {
  BinarySensor sensor;
  int num_protocols = 0;
  for (const char* key : {"canopen", "j1939", "dbc"}) num_protocols += map.has(key) ? 1 : 0;
  if (num_protocols != 1) {
    map.problem("canopen", "a sensor has one of: canopen, j1939, dbc");
    for (const char* key : {"canopen", "j1939", "dbc"}) map.raw(key);
  } else if (map.has("canopen")) {
    read_canopen(map.map("canopen"), sensor);
  } else if (map.has("j1939")) {
    read_j1939(map.map("j1939"), sensor);
  } else {
    read_dbc(map.map("dbc"), dbc, sensor);
  }
  map.read("invert", sensor.is_inverted);
  map.read("name", sensor.name);
  return sensor;
}

// Two that begin in one bit's reach would write into each other.
bool do_overlap(const BinarySensor& a, const BinarySensor& b) {
  if (a.protocol != b.protocol) return false;
  switch (a.protocol) {
    case BinarySensor::Protocol::kCanopen:
      return a.node == b.node && a.input == b.input;
    case BinarySensor::Protocol::kJ1939:
      return a.group_number == b.group_number && a.source_address == b.source_address &&
             a.instance == b.instance && std::abs(a.start_bit - b.start_bit) < 2;
    case BinarySensor::Protocol::kDbc:
      break;
  }
  return a.message == b.message && a.signal == b.signal;
}

}  // namespace

bool BinarySensors::have_way_back() const {
  const bool has_nodes = std::ranges::any_of(list, [](const BinarySensor& sensor) {
    return sensor.protocol == BinarySensor::Protocol::kCanopen;
  });
  return has_nodes && (starts_nodes || guards_nodes);
}

void BinarySensors::read(ConfigurationMap& map, const Dbc& dbc) {
  std::set<std::string> names;
  for (ConfigurationMap& entry : map.maps("sensors")) {
    BinarySensor sensor = read_sensor(entry, dbc);
    if (!sensor.name.empty() && !names.insert(sensor.name).second)
      entry.problem("name", "'" + sensor.name + "' is taken");
    const bool is_double = std::ranges::any_of(
        list, [&sensor](const BinarySensor& other) { return do_overlap(sensor, other); });
    if (is_double) entry.problem("name", "'" + sensor.name + "' shares bits with another sensor");
    list.push_back(std::move(sensor));
  }
  if (list.empty()) map.problem("sensors", "at least one sensor is needed");
  ConfigurationMap options = map.map("sensor_options");
  options.read("timeout_steps", timeout_steps, {1.0, 1e6});
  options.read("starts_nodes", starts_nodes);
  options.read("guards_nodes", guards_nodes);
  options.read("heeds_emergencies", heeds_emergencies);
  options.read("nodes_start_themselves", nodes_start_themselves);
  options.read("heartbeat_steps", heartbeat_steps, {0.0, 1e6});
  options.read("repeat_steps", repeat_steps, {1.0, 1e6});
  if (heartbeat_steps >= timeout_steps + 1)
    options.problem("heartbeat_steps", "is longer than timeout_steps: every node would be silent");
  if (heartbeat_steps == 0 && !guards_nodes)
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
