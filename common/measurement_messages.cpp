#include "common/measurement_messages.h"

#include <holdfast/measurement_set_t.hpp>

namespace holdfast {

void to_message(const MeasurementSet& set, measurement_set_t& message) {
  message.utime = set.utime;
  message.step = set.step;
  message.num_packets = static_cast<std::int32_t>(set.packets.size());
  message.packets.resize(set.packets.size());
  for (std::size_t i = 0; i < set.packets.size(); ++i) {
    const Packet& packet = set.packets[i];
    packet_t& out = message.packets[i];
    out.source = packet.source;
    out.rx_index = packet.rx_index;
    out.receive_utime = packet.receive_utime;
    out.step_counter = packet.step_counter;
    const auto values = set.values_of(packet);
    out.num_values = static_cast<std::int32_t>(values.size());
    out.values.assign(values.begin(), values.end());
  }
  message.num_invalid = static_cast<std::int32_t>(set.invalid.size());
  message.invalid.resize(set.invalid.size());
  for (std::size_t i = 0; i < set.invalid.size(); ++i) {
    message.invalid[i].source = set.invalid[i].source;
    message.invalid[i].reason = static_cast<std::int32_t>(set.invalid[i].reason);
  }
}

void from_message(const measurement_set_t& message, MeasurementSet& set) {
  set.clear(message.step, message.utime);
  set.seq = message.seq;
  for (const packet_t& in : message.packets) {
    Packet packet;
    packet.source = in.source;
    packet.rx_index = in.rx_index;
    packet.receive_utime = in.receive_utime;
    packet.step_counter = in.step_counter;
    set.add(packet, in.values);
  }
  for (const invalid_reading_t& in : message.invalid)
    set.invalid.push_back({in.source, static_cast<InvalidReason>(in.reason)});
}

}  // namespace holdfast
