#include "drivers/sensors/periodic_group.h"

#include <algorithm>
#include <span>

namespace holdfast {
namespace {

constexpr std::uint64_t kFaulty = 2;

bool is_selected(const DbcSignal& signal) {
  return signal.multiplexing == DbcSignal::Multiplexing::kMultiplexed;
}

}  // namespace

PeriodicGroup::PeriodicGroup(const BinarySensor& first, const Dbc& dbc, std::int64_t timeout_steps)
    : first_(first), timeout_steps_(timeout_steps) {
  if (first.protocol == BinarySensor::Protocol::kDbc) {
    message_ = require_message(dbc, first.message);
    return;
  }
  message_.identifier = j1939_identifier(first.group_number, first.source_address);
  message_.is_extended = true;
  message_.num_bytes = 8;
}

bool PeriodicGroup::holds(const BinarySensor& sensor) const {
  if (sensor.protocol != first_.protocol) return false;
  if (sensor.protocol == BinarySensor::Protocol::kDbc) return sensor.message == first_.message;
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
  if (is_selected(signal)) {
    const auto& ranges = signal.selector_ranges;
    const std::int64_t value = ranges.empty() ? signal.selector_value : ranges.front().first;
    if (std::ranges::find(selected_, value) == selected_.end()) selected_.push_back(value);
  }
  states_.push_back({signal});
  return states_.size() - 1;
}

bool PeriodicGroup::is_one(const CanFrame& frame) const {
  if (first_.protocol == BinarySensor::Protocol::kDbc)
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
  if (state.raw < kFaulty) return InvalidReason::kNone;
  const std::uint64_t all_ones =
      state.signal.num_bits >= 64 ? UINT64_MAX : (std::uint64_t{1} << state.signal.num_bits) - 1;
  return state.raw == all_ones ? InvalidReason::kNotAvailable : InvalidReason::kError;
}

void PeriodicGroup::encode(const std::vector<bool>& states, std::vector<CanFrame>& frames) const {
  const auto append = [&](std::int64_t value) {
    CanFrame frame = message_.empty_frame();
    const std::span<std::uint8_t> data(frame.data.data(), frame.num_bytes);
    if (first_.protocol == BinarySensor::Protocol::kJ1939) {
      std::fill_n(frame.data.begin(), frame.num_bytes, std::uint8_t{0xFF});
      if (first_.instance >= 0) frame.data[0] = static_cast<std::uint8_t>(first_.instance);
    }
    if (const DbcSignal* selector = message_.selector())
      selector->set_raw(data, static_cast<std::uint64_t>(value));
    for (std::size_t i = 0; i < states_.size(); ++i) {
      const DbcSignal& signal = states_[i].signal;
      if (!is_selected(signal) || signal.is_selected_by(value))
        signal.set_raw(data, states[i] ? 1 : 0);
    }
    frames.push_back(frame);
  };
  if (selected_.empty()) append(0);
  for (const std::int64_t value : selected_) append(value);
}

}  // namespace holdfast
