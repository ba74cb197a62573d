#include "tools/bus_look.h"

#include <algorithm>
#include <span>

#include "attacker/attack_match.h"
#include "drivers/can/hex_bytes.h"
#include "drivers/sensors/binary_sensors.h"
#include "tools/printable_text.h"
#include "tools/text_table.h"

namespace holdfast {
namespace {

constexpr std::size_t kBytesShown = 16;
constexpr std::uint32_t kSwitchBankGroup = 127501;

bool is_switch_bank(const CanFrame& frame) {
  return frame.has(CanFrame::kExtended) && frame.num_bytes > 0 &&
         j1939_group_number(frame.identifier) == kSwitchBankGroup;
}

std::string hex_of(std::span<const std::uint8_t> bytes) {
  std::string text;
  for (std::size_t i = 0; i < bytes.size() && i < kBytesShown; ++i) {
    if (i > 0) text += ' ';
    append_hex(bytes[i], 2, text);
  }
  return text + (bytes.size() > kBytesShown ? " .." : "");
}

std::string canopen_meaning(const CanFrame& frame) {
  const std::uint32_t node = frame.identifier & 0x7FU;
  const std::string of_node = " of node " + std::to_string(node);
  switch (frame.identifier & 0x780U) {
    case 0x000:
      return node == 0 ? "CANopen network management?" : "";
    case 0x080:
      return node == 0 ? "CANopen sync?" : "CANopen emergency" + of_node + "?";
    case 0x180:
      return node == 0 ? "" : "CANopen TPDO1" + of_node + "?";
    case 0x700:
      return node == 0 ? "" : "CANopen heartbeat" + of_node + "?";
    default:
      return "";
  }
}

bool is_binary(const DbcSignal& signal) {
  return signal.kind == DbcSignal::Kind::kUnsigned && signal.num_bits <= 2;
}

}  // namespace

void BusLook::on_frame(const CanFrame& frame, std::int64_t time_ns) {
  ++num_frames_;
  std::uint64_t key = frame_key(frame.identifier, frame.has(CanFrame::kExtended));
  // Its first byte says which of several banks speaks.
  if (is_switch_bank(frame)) key |= static_cast<std::uint64_t>(frame.data[0] + 1U) << 32;
  const auto found = seen_.find(key);
  if (found == seen_.end() && seen_.size() >= kIdentifiersMax) {
    ++num_left_out_;
    return;
  }
  Seen& seen = seen_[key];
  if (seen.count++ == 0) {
    seen.first_ns = time_ns;
  } else if (!frame.has(CanFrame::kRemote)) {
    const std::size_t common = std::min(frame.num_bytes, seen.latest.num_bytes);
    for (std::size_t i = 0; i < common; ++i)
      seen.changed[i] =
          static_cast<std::uint8_t>(seen.changed[i] | (seen.latest.data[i] ^ frame.data[i]));
  }
  seen.last_ns = time_ns;
  // A request holds nothing to compare with.
  if (seen.count == 1 || !frame.has(CanFrame::kRemote)) seen.latest = frame;
}

std::string BusLook::meaning_of(const Seen& seen) const {
  const CanFrame& frame = seen.latest;
  const bool is_extended = frame.has(CanFrame::kExtended);
  if (const DbcMessage* message = dbc_.find(frame.identifier, is_extended)) {
    return printable(message->name, 60) +
           (frame.has(CanFrame::kRemote) || message->matches(frame) ? "" : " (another form)");
  }
  if (!is_extended) return canopen_meaning(frame);
  return "J1939 group " + std::to_string(j1939_group_number(frame.identifier)) + " of " +
         std::to_string(frame.identifier & 0xFFU) + "?";
}

std::string BusLook::sensors_of(const Seen& seen) const {
  const CanFrame& frame = seen.latest;
  const bool is_extended = frame.has(CanFrame::kExtended);
  std::string lines;
  if (const DbcMessage* message = dbc_.find(frame.identifier, is_extended)) {
    for (const DbcSignal& signal : message->signals) {
      if (is_binary(signal))
        lines += "    - {dbc: {message: " + message->name + ", signal: " + signal.name + "}}\n";
    }
    return lines;
  }
  const auto has_changed = [&seen](std::size_t bit) {
    return (seen.changed[bit / 8] >> (bit % 8) & 1U) != 0;
  };
  const std::size_t num_bits = std::min<std::size_t>(8 * frame.num_bytes, 64);
  if (!is_extended) {
    const std::uint32_t node = frame.identifier & 0x7FU;
    if ((frame.identifier & 0x780U) != 0x180 || node == 0) return "";
    for (std::size_t bit = 0; bit < num_bits; ++bit) {
      if (has_changed(bit))
        lines += "    - {canopen: {node: " + std::to_string(node) +
                 ", input: " + std::to_string(bit + 1) + "}}\n";
    }
    return lines;
  }
  const bool is_bank = is_switch_bank(frame);
  for (std::size_t bit = is_bank ? 8 : 0; bit + 1 < num_bits; bit += 2) {
    if (!has_changed(bit) && !has_changed(bit + 1)) continue;
    lines += "    - {j1939: {pgn: " + std::to_string(j1939_group_number(frame.identifier)) +
             ", source: " + std::to_string(frame.identifier & 0xFFU);
    lines += is_bank ? ", instance: " + std::to_string(frame.data[0]) +
                           ", item: " + std::to_string((bit - 8) / 2 + 1)
                     : ", start_bit: " + std::to_string(bit);
    lines += "}}\n";
  }
  return lines;
}

std::string BusLook::text() const {
  if (seen_.empty()) return "No frame came.\n";
  TextTable table(1);
  table.add(
      {"identifier", "frames", "per s", "bytes", "latest", "changing bits", "what it may be"});
  std::string sensors;
  for (const auto& [key, seen] : seen_) {
    const double seconds = static_cast<double>(seen.last_ns - seen.first_ns) * 1e-9;
    const std::string rate =
        seconds > 0.0 ? number_text(static_cast<double>(seen.count - 1) / seconds, 3) : "-";
    const std::size_t size = seen.latest.num_bytes;
    table.add({identifier_text(seen.latest), std::to_string(seen.count), rate, std::to_string(size),
               hex_of(seen.latest.bytes()), hex_of({seen.changed.data(), size}), meaning_of(seen)});
    sensors += sensors_of(seen);
  }
  std::string text = table.text();
  if (num_left_out_ > 0)
    text += std::to_string(num_left_out_) + " frames of further identifiers are not shown.\n";
  if (!sensors.empty())
    text += "\nBits and signals that may be binary sensors; take those that are:\n\n  sensors:\n" +
            sensors;
  return text;
}

}  // namespace holdfast
