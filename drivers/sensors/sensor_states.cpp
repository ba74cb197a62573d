#include "drivers/sensors/sensor_states.h"

#include <algorithm>
#include <iterator>

namespace holdfast {
namespace {

bool is_node(const BinarySensor& sensor) {
  return sensor.protocol == BinarySensor::Protocol::kCanopen;
}

// Its gateway still speaks when the sensor does not.
bool is_behind_gateway(const BinarySensor& sensor) {
  return sensor.protocol == BinarySensor::Protocol::kModbus;
}

// The group of the sensor, a new one where there is none yet.
std::size_t group_of(const BinarySensor& sensor, const Dbc& dbc, std::int64_t timeout_steps,
                     std::vector<PeriodicGroup>& groups) {
  for (std::size_t i = 0; i < groups.size(); ++i) {
    if (groups[i].holds(sensor)) return i;
  }
  groups.emplace_back(sensor, dbc, timeout_steps);
  return groups.size() - 1;
}

// What a sensor says through its wire: an inverted one says 0 when it sees something.
bool wire_state(const BinarySensor& sensor, bool state) {
  return state != sensor.is_inverted;
}

}  // namespace

SensorStates::SensorStates(const BinarySensors& sensors, const Dbc& dbc) : sensors_(sensors) {
  for (const BinarySensor& sensor : sensors_.list) {
    if (!is_node(sensor)) {
      const std::size_t group = group_of(sensor, dbc, sensors_.timeout_steps, groups_);
      places_.push_back({false, group, groups_[group].add(sensor)});
      continue;
    }
    auto found = std::ranges::find(nodes_, sensor.node, &CanopenRemote::node);
    if (found == nodes_.end())
      found = nodes_.emplace(nodes_.end(), sensor.node, sensors_.timeout_steps);
    places_.push_back({true, static_cast<std::size_t>(found - nodes_.begin()),
                       static_cast<std::size_t>(sensor.input - 1)});
  }
  node_heard_.resize(nodes_.size());
  group_heard_.resize(groups_.size());
}

SensorStates::Taken SensorStates::on_frame(const CanFrame& frame, std::int64_t rx_index,
                                           std::int64_t step) {
  Taken taken = Taken::kUnknown;
  // One frame may serve several: a group that is read with and without its instance.
  const auto take = [&](auto& device, bool is_its, bool tells, Heard& heard) {
    if (!is_its) return;
    if (!device.on_frame(frame, step)) {
      if (taken == Taken::kUnknown) taken = Taken::kWrongFormat;
      return;
    }
    taken = Taken::kTaken;
    if (tells) heard = {rx_index, frame.receive_time_ns / 1000};
  };
  for (std::size_t i = 0; i < nodes_.size(); ++i)
    take(nodes_[i], nodes_[i].sends(frame), nodes_[i].tells_inputs(frame), node_heard_[i]);
  for (std::size_t i = 0; i < groups_.size(); ++i)
    take(groups_[i], groups_[i].is_one(frame), true, group_heard_[i]);
  return taken;
}

void SensorStates::sample(std::int64_t step, MeasurementSet& set) const {
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const Place& place = places_[i];
    const InvalidReason reason = place.is_node
                                     ? nodes_[place.index].reason(static_cast<int>(place.place) + 1,
                                                                  step, sensors_.heeds_emergencies)
                                     : groups_[place.index].reason(place.place, step);
    if (reason != InvalidReason::kNone) {
      set.invalid.push_back({static_cast<int>(i), reason});
      continue;
    }
    const bool on_wire = place.is_node ? (nodes_[place.index].inputs() >> place.place & 1U) != 0
                                       : groups_[place.index].state(place.place);
    const Heard& heard = place.is_node ? node_heard_[place.index] : group_heard_[place.index];
    Packet packet;
    packet.source = static_cast<int>(i);
    packet.rx_index = heard.rx_index;
    packet.receive_utime = heard.receive_utime;
    const double value = wire_state(sensors_.list[i], on_wire) ? 1.0 : 0.0;
    set.add(packet, {&value, 1});
  }
}

void SensorStates::ask(std::int64_t step, std::vector<CanFrame>& frames) const {
  for (const CanopenRemote& node : nodes_) {
    if (sensors_.guards_nodes) frames.push_back(node.guard_request());
    if (sensors_.starts_nodes && node.wants_start(step)) frames.push_back(node.start_command());
  }
}

SensorTwins::SensorTwins(const BinarySensors& sensors, const Dbc& dbc) : sensors_(sensors) {
  for (std::size_t i = 0; i < sensors_.list.size(); ++i) {
    const BinarySensor& sensor = sensors_.list[i];
    const auto is_same = [&](const Device& device) {
      const BinarySensor& first = sensors_.list[device.sensors.front()];
      return is_node(sensor) ? is_node(first) && first.node == sensor.node
                             : device.node < 0 && groups_[device.group].holds(sensor);
    };
    auto found = std::ranges::find_if(devices_, is_same);
    if (found == devices_.end()) found = devices_.emplace(devices_.end());
    found->sensors.push_back(i);
    std::ranges::copy_if(
        sensors_.outages, std::back_inserter(found->outages),
        [&sensor](const SensorOutage& outage) { return outage.sensor == sensor.name; });
    if (is_node(sensor)) {
      found->node = 0;  // numbered below
      found->inputs.push_back(static_cast<std::size_t>(sensor.input - 1));
    } else {
      found->group = group_of(sensor, dbc, sensors_.timeout_steps, groups_);
      groups_[found->group].add(sensor);
    }
  }
  for (Device& device : devices_) {
    if (device.node < 0) continue;
    const std::size_t last = *std::ranges::max_element(device.inputs);
    device.node = static_cast<int>(nodes_.size());
    nodes_.emplace_back(sensors_.list[device.sensors.front()].node, static_cast<int>(last) + 1,
                        sensors_);
  }
}

bool SensorTwins::Device::is_silent(std::int64_t step) const {
  return std::ranges::any_of(outages, [step](const SensorOutage& outage) {
    return step >= outage.first_step && step <= outage.last_step;
  });
}

void SensorTwins::step(std::int64_t step, const std::vector<std::vector<double>>& readings,
                       std::vector<CanFrame>& frames) {
  for (const Device& device : devices_) {
    const bool silent = device.is_silent(step);
    states_.clear();
    std::uint64_t inputs = 0;
    for (std::size_t i = 0; i < device.sensors.size(); ++i) {
      const std::size_t sensor = device.sensors[i];
      const bool state = wire_state(sensors_.list[sensor], readings[sensor].front() != 0.0);
      states_.push_back(state ? 1 : 0);
      if (device.node >= 0 && state) inputs |= std::uint64_t{1} << device.inputs[i];
    }
    if (device.node >= 0) {
      nodes_[static_cast<std::size_t>(device.node)].step(inputs, silent, frames);
    } else if (silent && is_behind_gateway(sensors_.list[device.sensors.front()])) {
      std::ranges::fill(states_, PeriodicGroup::kNotAvailable);
      groups_[device.group].encode(states_, frames);
    } else if (!silent) {
      groups_[device.group].encode(states_, frames);
    }
  }
}

void SensorTwins::on_frame(const CanFrame& frame) {
  for (CanopenDevice& node : nodes_) node.on_frame(frame);
}

bool is_for_sensors(const BinarySensors& sensors, const CanFrame& frame) {
  if (!sensors.have_way_back() || frame.has(CanFrame::kExtended)) return false;
  if (!frame.has(CanFrame::kRemote)) return frame.identifier == 0 && frame.num_bytes == 2;
  return frame.identifier > 0x700 && frame.identifier <= 0x77F;
}

}  // namespace holdfast
