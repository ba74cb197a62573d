#include "drivers/sensors/periodic_group.h"

#include <algorithm>
#include <optional>

namespace holdfast {
PeriodicGroup::PeriodicGroup(const BinarySensor& first, const Dbc& dbc, std::int64_t timeout_steps)
    : first_(first), timeout_steps_(timeout_steps) {
  if (first.protocol == BinarySensor::Protocol::kDbc) {
    message_ = require_message(dbc, first.message);
    empty_ = message_.empty_frame();
    return;
  }
  message_.is_extended = first.protocol == BinarySensor::Protocol::kJ1939;
  message_.identifier = message_.is_extended
                            ? j1939_identifier(first.group_number, first.source_address)
                            : first.identifier;
  message_.num_bytes = 8;
  empty_ = message_.empty_frame();
  std::fill_n(empty_.data.begin(), empty_.num_bytes, std::uint8_t{0xFF});
  if (first.instance >= 0) empty_.data[0] = static_cast<std::uint8_t>(first.instance);
}

bool PeriodicGroup::holds(const BinarySensor& sensor) const {
  if (sensor.protocol != first_.protocol) return false;
  if (sensor.protocol == BinarySensor::Protocol::kDbc) return sensor.message == first_.message;
  if (sensor.protocol == BinarySensor::Protocol::kModbus) return sensor.unit == first_.unit;
  return sensor.group_number == first_.group_number &&
         sensor.source_address == first_.source_address && sensor.instance == first_.instance;
}

std::size_t PeriodicGroup::add(const BinarySensor& sensor) {
  DbcSignal signal;
  if (sensor.protocol == BinarySensor::Protocol::kDbc) {
    signal = require_signal(message_, sensor.signal);
  } else {
    signal.start_bit = sensor.start_bit;
    signal.num_bits = 2;
  }
  if (signal.is_multiplexed()) {
    const std::optional<CanFrame> frame = message_.frame_for({signal});
    const auto is_same = [&](const CanFrame& other) { return frame->same_on_wire(other); };
    if (frame && std::ranges::none_of(selections_, is_same)) selections_.push_back(*frame);
  }
  states_.push_back({signal});
  return states_.size() - 1;
}

bool PeriodicGroup::is_one(const CanFrame& frame) const {
  if (first_.protocol != BinarySensor::Protocol::kJ1939)
    return frame.identifier == message_.identifier &&
           frame.has(CanFrame::kExtended) == message_.is_extended;
  // Priority is for the bus, destination for whom it is sent to: neither says what it is.
  const bool is_group = frame.has(CanFrame::kExtended) &&
                        j1939_group_number(frame.identifier) == first_.group_number &&
                        static_cast<int>(frame.identifier & 0xFFU) == first_.source_address;
  return is_group && (first_.instance < 0 || frame.num_bytes == 0 ||
                      frame.data[0] == static_cast<std::uint8_t>(first_.instance));
}

bool PeriodicGroup::on_frame(const CanFrame& frame, std::int64_t step) {
  const bool is_dbc = first_.protocol == BinarySensor::Protocol::kDbc;
  if (frame.has(CanFrame::kRemote) || (is_dbc && !message_.matches(frame))) return false;
  if (!is_dbc && frame.has(CanFrame::kFd)) return false;
  const bool was_silent = last_step_ > 0 && step - 1 - last_step_ >= timeout_steps_;
  bool fits = false;
  for (State& state : states_) {
    if (was_silent) state.is_told = false;
    if (!state.signal.fits(frame.num_bytes)) {
      state.is_told = false;
      continue;
    }
    fits = true;
    // In a frame in which the multiplexer selects others the state stays as it was.
    if (is_dbc && !message_.carries(state.signal, frame.bytes())) continue;
    state.raw = state.signal.raw(frame.bytes());
    state.is_told = true;
  }
  if (fits) last_step_ = step;
  return fits;
}

InvalidReason PeriodicGroup::reason(std::size_t place, std::int64_t step) const {
  if (last_step_ == 0) return InvalidReason::kNeverHeard;
  if (step - last_step_ >= timeout_steps_) return InvalidReason::kSilent;
  const State& state = states_[place];
  if (!state.is_told) return InvalidReason::kNotAvailable;
  if (state.raw < kError) return InvalidReason::kNone;
  const std::uint64_t all_ones =
      state.signal.num_bits >= 64 ? UINT64_MAX : (std::uint64_t{1} << state.signal.num_bits) - 1;
  return state.raw == all_ones ? InvalidReason::kNotAvailable : InvalidReason::kError;
}

void PeriodicGroup::encode(std::span<const std::uint8_t> states,
                           std::vector<CanFrame>& frames) const {
  const auto append = [&](const CanFrame& selection) {
    CanFrame frame = selection;
    for (std::size_t i = 0; i < states_.size(); ++i) {
      const DbcSignal& signal = states_[i].signal;
      if (message_.carries(signal, selection.bytes()))
        signal.set_raw({frame.data.data(), frame.num_bytes}, states[i]);
    }
    frames.push_back(frame);
  };
  if (selections_.empty()) append(empty_);
  for (const CanFrame& selection : selections_) append(selection);
}

}  // namespace holdfast
