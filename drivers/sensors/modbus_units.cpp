#include "drivers/sensors/modbus_units.h"

#include <algorithm>
#include <stdexcept>

namespace holdfast {
namespace {

constexpr std::size_t kStepsWaitingMost = 100'000;

bool is_of_unit(const BinarySensor& sensor, int unit) {
  return sensor.protocol == BinarySensor::Protocol::kModbus && sensor.unit == unit;
}

// Of the unit's sensors, in their order: the places of its states.
std::vector<int> addresses_of(const BinarySensors& sensors, int unit) {
  std::vector<int> addresses;
  for (const BinarySensor& sensor : sensors.list) {
    if (is_of_unit(sensor, unit)) addresses.push_back(sensor.address);
  }
  return addresses;
}

PeriodicGroup group_of_unit(const BinarySensors& sensors, int unit) {
  const auto first = std::ranges::find_if(
      sensors.list, [unit](const BinarySensor& sensor) { return is_of_unit(sensor, unit); });
  if (first == sensors.list.end()) throw std::logic_error("a Modbus unit without sensors");
  PeriodicGroup group(*first, {}, sensors.timeout_steps);
  for (const BinarySensor& sensor : sensors.list) {
    if (is_of_unit(sensor, unit)) group.add(sensor);
  }
  return group;
}

}  // namespace

ModbusUnit::ModbusUnit(const BinarySensors& sensors, int unit)
    : unit_(unit), group_(group_of_unit(sensors, unit)) {
  const std::vector<int> addresses = addresses_of(sensors, unit);
  states_.assign(addresses.size(), PeriodicGroup::kNotAvailable);
  std::vector<std::size_t> places(addresses.size());
  for (std::size_t i = 0; i < places.size(); ++i) places[i] = i;
  std::ranges::sort(places, {}, [&addresses](std::size_t place) { return addresses[place]; });
  for (const std::size_t place : places) {
    const bool continues = !requests_.empty() &&
                           addresses[place] == requests_.back().first_input +
                                                   static_cast<int>(requests_.back().places.size());
    if (!continues) requests_.push_back({addresses[place], {}});
    requests_.back().places.push_back(place);
  }
}

void ModbusUnit::take(const ModbusRequest& request, ModbusAnswer answer,
                      std::span<const std::uint8_t> inputs) {
  const bool nobody_spoke = answer == ModbusAnswer::kSilent || answer == ModbusAnswer::kLineGone;
  const std::uint8_t missing = nobody_spoke ? PeriodicGroup::kNotAvailable : PeriodicGroup::kError;
  for (std::size_t i = 0; i < request.places.size(); ++i) {
    states_[request.places[i]] = answer != ModbusAnswer::kInputs ? missing
                                 : inputs[i] != 0                ? std::uint8_t{1}
                                                                 : std::uint8_t{0};
  }
}

std::vector<ModbusUnit> modbus_units(const BinarySensors& sensors) {
  std::vector<ModbusUnit> units;
  for (const BinarySensor& sensor : sensors.list) {
    if (sensor.protocol == BinarySensor::Protocol::kModbus &&
        std::ranges::find(units, sensor.unit, &ModbusUnit::unit) == units.end())
      units.emplace_back(sensors, sensor.unit);
  }
  return units;
}

ModbusTwin::ModbusTwin(const BinarySensors& sensors, int unit, bool is_in_step)
    : unit_(sensors, unit),
      group_(group_of_unit(sensors, unit)),
      is_in_step_(is_in_step),
      addresses_(addresses_of(sensors, unit)),
      first_input_(unit_.requests().front().first_input) {
  const ModbusRequest& last = unit_.requests().back();
  inputs_.resize(static_cast<std::size_t>(last.first_input - first_input_) + last.places.size());
}

void ModbusTwin::on_frame(const CanFrame& frame) {
  if (!group_.is_one(frame) || !group_.on_frame(frame, step_)) return;
  filling_ = {true, 0};
  for (std::size_t place = 0; place < addresses_.size(); ++place) {
    if (group_.reason(place, step_) != InvalidReason::kNone) filling_.is_told = false;
    if (group_.state(place)) filling_.states |= std::uint32_t{1} << place;
  }
}

void ModbusTwin::end_step() {
  ++step_;
  if (!is_in_step_) waiting_.clear();
  waiting_.push_back(filling_);
  filling_ = {};
  if (waiting_.size() > kStepsWaitingMost) {
    waiting_.pop_front();
    ++num_forgotten_;
  }
}

ModbusTwin::Reply ModbusTwin::on_request(int first_asked) {
  // In step the other requests of a round are about the same step as its first.
  const bool shows_next = !is_in_step_ || first_asked == first_input_;
  if (shows_next && waiting_.empty() && is_in_step_) return Reply::kNotYet;
  if (shows_next && !waiting_.empty()) {
    shown_ = waiting_.front();
    waiting_.pop_front();
    std::ranges::fill(inputs_, std::uint8_t{0});
    for (std::size_t place = 0; place < addresses_.size(); ++place)
      inputs_[static_cast<std::size_t>(addresses_[place] - first_input_)] =
          (shown_.states >> place & 1U) != 0 ? 1 : 0;
  }
  return shown_.is_told ? Reply::kAnswer : Reply::kSilent;
}

}  // namespace holdfast
