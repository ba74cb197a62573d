#include "tools/log_fields.h"

#include <holdfast/layouts.h>
#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <holdfast/attack_frame_t.hpp>
#include <holdfast/attack_signal_t.hpp>
#include <holdfast/can_frames_t.hpp>
#include <holdfast/estimate_t.hpp>
#include <holdfast/known_input_t.hpp>
#include <holdfast/measurement_set_t.hpp>
#include <holdfast/run_meta_t.hpp>
#include <holdfast/status_t.hpp>
#include <holdfast/timing_t.hpp>
#include <holdfast/truth_t.hpp>

namespace holdfast {
namespace {

constexpr std::string_view kIntegerFields[] = {"utime",
                                               "seq",
                                               "step",
                                               "measurement_seq",
                                               "input_step",
                                               "packet_rx_index",
                                               "index",
                                               "receive_utime",
                                               "rx_index",
                                               "tx_index",
                                               "draw_index",
                                               "generation",
                                               "step_counter",
                                               "seed",
                                               "run",
                                               "counter_value",
                                               "compute_time_ns",
                                               "latency_ns"};

template <class Message>
ChannelType type_of(bool is_once_per_step) {
  return {layouts::of<Message>, Message::getHash(), is_once_per_step};
}

}  // namespace

ChannelType channel_type(std::string_view channel) {
  if (channel.starts_with("EST_") || channel.starts_with("SMOOTHED_"))
    return type_of<estimate_t>(true);
  if (channel == "MEASUREMENT") return type_of<measurement_set_t>(true);
  if (channel == "PLANT_TRUTH") return type_of<truth_t>(true);
  if (channel == "KNOWN_INPUT") return type_of<known_input_t>(true);
  if (channel == "ATTACK_SIGNAL") return type_of<attack_signal_t>(false);
  if (channel == "ATTACK_FRAME") return type_of<attack_frame_t>(false);
  if (channel == "CAN_RX" || channel == "CAN_TX" || channel == "CAN_COMMAND")
    return type_of<can_frames_t>(false);
  if (channel.starts_with("TIMING_")) return type_of<timing_t>(false);
  if (channel.starts_with("STATUS_")) return type_of<status_t>(false);
  if (channel == "RUN_META") return type_of<run_meta_t>(false);
  return {};
}

bool is_integer_field(std::string_view name) {
  return std::ranges::find(kIntegerFields, name) != std::end(kIntegerFields);
}

std::string field_text(const FieldLayout& field, std::uint64_t bits) {
  char text[64];
  std::to_chars_result end{};
  if (field.element_bytes == 8 && !is_integer_field(field.name)) {
    const auto value = std::bit_cast<double>(bits);
    if (std::isnan(value)) return "nan";
    end = std::to_chars(text, text + sizeof text, value, std::chars_format::general, 17);
  } else if (field.element_bytes == 1) {
    end = std::to_chars(text, text + sizeof text, bits);  // LCM's byte has no sign
  } else {
    const int unused_bits = 64 - 8 * static_cast<int>(field.element_bytes);
    end = std::to_chars(text, text + sizeof text,
                        static_cast<std::int64_t>(bits << unused_bits) >> unused_bits);
  }
  return {text, end.ptr};
}

FieldValue FieldReader::take(const FieldLayout& field) {
  if (field.kind != FieldKind::kString) return {take_number(field.element_bytes), {}};
  const auto size = static_cast<std::size_t>(take_number(4));
  const std::string_view text(reinterpret_cast<const char*>(bytes_.data()), size - 1);
  bytes_ = bytes_.subspan(size);
  return {0, text};
}

std::uint64_t FieldReader::take_number(std::size_t count) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < count; ++i) value = (value << 8) | bytes_[i];
  bytes_ = bytes_.subspan(count);
  return value;
}

}  // namespace holdfast
