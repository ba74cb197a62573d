#include "drivers/can/frame_codec.h"

#include <algorithm>
#include <cmath>

#include "common/errors.h"

namespace holdfast {
namespace {

constexpr std::int32_t kNoEntry = -1;
constexpr std::int32_t kTickEntry = -2;
constexpr std::size_t kStandardIdentifiers = 2048;

std::uint64_t mask_of(const DbcSignal& signal) {
  return ~std::uint64_t{0} >> (64 - signal.num_bits);
}

}  // namespace

FrameCodec::Entry FrameCodec::make_entry(const FrameLayout& layout,
                                         const std::string& message_name) {
  Entry entry;
  entry.message = require_message(layout.dbc, message_name);
  for (const std::string& name : layout.signals)
    entry.values.push_back(require_signal(entry.message, name));
  if (!layout.counter_signal.empty())
    entry.counter = require_signal(entry.message, layout.counter_signal);
  const auto note = [&](const DbcSignal& signal) {
    if (signal.is_multiplexed()) entry.multiplexed.push_back(signal);
  };
  for (const DbcSignal& signal : entry.values) note(signal);
  if (entry.counter) note(*entry.counter);
  if (const FrameProtection* protection = layout.find_protection(message_name))
    entry.protection = *protection;
  const std::optional<CanFrame> empty = entry.message.frame_for(entry.multiplexed);
  if (!empty) throw UsageError("no frame of message " + message_name + " carries all its signals");
  entry.empty = *empty;
  return entry;
}

FrameCodec::FrameCodec(const FrameLayout& layout)
    : entry_of_standard_(kStandardIdentifiers, kNoEntry),
      tick_(require_message(layout.dbc, layout.tick_message)),
      tick_step_(require_signal(tick_, layout.tick_signal)),
      tick_mask_(mask_of(tick_step_)) {
  const auto enter = [&](const DbcMessage& message, std::int32_t entry) {
    if (message.is_extended) {
      entry_of_extended_.emplace_back(message.identifier, entry);
    } else {
      entry_of_standard_[message.identifier] = entry;
    }
  };
  enter(tick_, kTickEntry);
  if (layout.sensors.exist()) {
    sensors_ = layout.sensors;
    dbc_ = layout.dbc;
    return;
  }
  for (const std::string& name : layout.messages) {
    Entry entry = make_entry(layout, name);
    if (entry.counter) counter_mask_ = mask_of(*entry.counter);
    enter(entry.message, static_cast<std::int32_t>(messages_.size()));
    messages_.push_back(std::move(entry));
  }
  std::sort(entry_of_extended_.begin(), entry_of_extended_.end());
}

std::optional<SensorStates> FrameCodec::make_sensor_states() const {
  return sensors_.exist() ? std::optional<SensorStates>(std::in_place, sensors_, dbc_)
                          : std::nullopt;
}

std::optional<SensorTwins> FrameCodec::make_sensor_twins() const {
  return sensors_.exist() ? std::optional<SensorTwins>(std::in_place, sensors_, dbc_)
                          : std::nullopt;
}

CanFrame FrameCodec::encode(int source, std::span<const double> values, std::int64_t step) const {
  const Entry& entry = messages_[static_cast<std::size_t>(source)];
  CanFrame frame = entry.empty;
  const std::span<std::uint8_t> data(frame.data.data(), frame.num_bytes);
  for (std::size_t i = 0; i < entry.values.size(); ++i) entry.values[i].pack(data, values[i]);
  if (entry.counter) entry.counter->set_raw(data, static_cast<std::uint64_t>(step));
  if (entry.protection) {
    entry.protection->set_counter(data, step);
    entry.protection->seal(data);
  }
  return frame;
}

CanFrame FrameCodec::encode_tick(std::int64_t step) const {
  CanFrame frame = tick_.empty_frame();
  tick_step_.set_raw(frame.data, static_cast<std::uint64_t>(step));
  return frame;
}

int FrameCodec::entry_of(const CanFrame& frame) const {
  if (!frame.has(CanFrame::kExtended)) {
    return frame.identifier < kStandardIdentifiers ? entry_of_standard_[frame.identifier]
                                                   : kNoEntry;
  }
  const auto found = std::lower_bound(entry_of_extended_.begin(), entry_of_extended_.end(),
                                      std::pair{frame.identifier, std::int32_t{kTickEntry}});
  return found != entry_of_extended_.end() && found->first == frame.identifier ? found->second
                                                                               : kNoEntry;
}

FrameCodec::Decoded FrameCodec::decode(const CanFrame& frame, std::vector<double>& values) const {
  Decoded decoded;
  const int index = entry_of(frame);
  if (index == kNoEntry) return decoded;
  decoded.kind = Kind::kWrongFormat;
  if (index == kTickEntry) {
    if (!tick_.matches(frame)) return decoded;
    decoded.kind = Kind::kTick;
    decoded.tick_step = static_cast<std::int64_t>(tick_step_.raw(frame.bytes()));
    return decoded;
  }
  const Entry& entry = messages_[static_cast<std::size_t>(index)];
  const bool is_complete = std::ranges::all_of(entry.multiplexed, [&](const DbcSignal& signal) {
    return entry.message.carries(signal, frame.bytes());
  });
  if (!entry.message.matches(frame) || !is_complete) return decoded;
  if (entry.protection && !entry.protection->is_sound(frame.bytes())) {
    decoded.kind = Kind::kWrongChecksum;
    return decoded;
  }
  const std::size_t first = values.size();
  for (const DbcSignal& signal : entry.values) {
    const double value = signal.unpack(frame.bytes());
    if (!std::isfinite(value)) {
      values.resize(first);
      decoded.kind = Kind::kNonFinite;
      return decoded;
    }
    values.push_back(value);
  }
  decoded.kind = Kind::kReading;
  decoded.packet.source = index;
  decoded.packet.first_value = static_cast<std::uint32_t>(first);
  decoded.packet.num_values = static_cast<std::uint32_t>(entry.values.size());
  if (entry.counter) {
    decoded.packet.step_counter = static_cast<std::int64_t>(entry.counter->raw(frame.bytes()));
  }
  return decoded;
}

bool FrameCodec::counter_matches(std::int64_t counter, std::int64_t step) const {
  if (counter_mask_ == 0) return true;
  return static_cast<std::uint64_t>(counter) == (static_cast<std::uint64_t>(step) & counter_mask_);
}

bool FrameCodec::tick_matches(std::int64_t tick_step, std::int64_t step) const {
  return static_cast<std::uint64_t>(tick_step) == (static_cast<std::uint64_t>(step) & tick_mask_);
}

}  // namespace holdfast
