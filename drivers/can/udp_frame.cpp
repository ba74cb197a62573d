#include "drivers/can/udp_frame.h"

#include <cstring>
#include <exception>
#include <msgpack.hpp>
#include <string_view>

namespace holdfast {
namespace {

enum Key {
  kTimestamp,
  kArbitrationId,
  kIsExtendedId,
  kIsRemoteFrame,
  kIsErrorFrame,
  kChannel,
  kDlc,
  kData,
  kIsFd,
  kBitrateSwitch,
  kErrorStateIndicator,
  kNumKeys
};

// In the order in which python-can writes them; any order is read.
constexpr std::array<std::string_view, kNumKeys> kKeyNames = {"timestamp",
                                                              "arbitration_id",
                                                              "is_extended_id",
                                                              "is_remote_frame",
                                                              "is_error_frame",
                                                              "channel",
                                                              "dlc",
                                                              "data",
                                                              "is_fd",
                                                              "bitrate_switch",
                                                              "error_state_indicator"};

constexpr std::uint32_t kChannelNameMax = 64;

/// What msgpack's packer writes to: a fixed slot.
struct SlotWriter {
  std::span<std::uint8_t> bytes;
  std::size_t num_written = 0;

  void write(const char* data, std::size_t size) {
    std::memcpy(bytes.data() + num_written, data, size);
    num_written += size;
  }
};

void pack_text(msgpack::packer<SlotWriter>& packer, std::string_view text) {
  packer.pack_str(static_cast<std::uint32_t>(text.size()));
  packer.pack_str_body(text.data(), static_cast<std::uint32_t>(text.size()));
}

/// Follows the parser and stops it at the first thing that does not belong into a frame's map, so
/// that no hostile length is ever acted on.
class FrameVisitor : public msgpack::null_visitor {
 public:
  std::optional<CanFrame> frame() const;

  bool start_map(std::uint32_t num_pairs) {
    return !std::exchange(is_in_map_, true) && num_pairs == kNumKeys;
  }
  bool start_map_key() { return is_reading_key_ = true; }
  bool end_map_key() {
    is_reading_key_ = false;
    return true;
  }
  bool start_array(std::uint32_t) { return false; }
  bool visit_ext(const char*, std::uint32_t) { return false; }
  bool visit_nil() { return is_value_of(kChannel); }
  bool visit_boolean(bool value);
  bool visit_positive_integer(std::uint64_t value);
  bool visit_negative_integer(std::int64_t) {
    return is_value_of(kChannel) || is_value_of(kTimestamp);
  }
  bool visit_float32(float) { return is_value_of(kTimestamp); }
  bool visit_float64(double) { return is_value_of(kTimestamp); }
  bool visit_str(const char* text, std::uint32_t size);
  bool visit_bin(const char* data, std::uint32_t size);

 private:
  bool is_value_of(Key key) const { return is_in_map_ && !is_reading_key_ && key_ == key; }
  bool set_key(std::string_view name);

  bool is_in_map_ = false;
  bool is_reading_key_ = false;
  int key_ = kNumKeys;
  std::uint32_t keys_seen_ = 0;  // one bit each
  std::uint64_t dlc_ = 0;
  std::size_t data_size_ = 0;
  CanFrame frame_;
};

bool FrameVisitor::set_key(std::string_view name) {
  for (key_ = 0; key_ < kNumKeys; ++key_) {
    if (kKeyNames[static_cast<std::size_t>(key_)] != name) continue;
    const std::uint32_t bit = 1U << key_;
    if ((keys_seen_ & bit) != 0) return false;
    keys_seen_ |= bit;
    return true;
  }
  return false;
}

bool FrameVisitor::visit_boolean(bool value) {
  if (!is_in_map_ || is_reading_key_) return false;
  CanFrame::Flag flag{};
  switch (key_) {
    case kIsExtendedId:
      flag = CanFrame::kExtended;
      break;
    case kIsRemoteFrame:
      flag = CanFrame::kRemote;
      break;
    case kIsErrorFrame:
      flag = CanFrame::kError;
      break;
    case kIsFd:
      flag = CanFrame::kFd;
      break;
    case kBitrateSwitch:
      flag = CanFrame::kBitRateSwitch;
      break;
    case kErrorStateIndicator:
      flag = CanFrame::kErrorStateIndicator;
      break;
    default:
      return false;
  }
  if (value) frame_.flags |= flag;
  return true;
}

bool FrameVisitor::visit_positive_integer(std::uint64_t value) {
  if (is_value_of(kTimestamp) || is_value_of(kChannel)) return true;
  if (is_value_of(kDlc)) {
    dlc_ = value;
    return value <= CanFrame::kBytesMax;
  }
  if (!is_value_of(kArbitrationId) || value > 0x1FFFFFFF) return false;
  frame_.identifier = static_cast<std::uint32_t>(value);
  return true;
}

bool FrameVisitor::visit_str(const char* text, std::uint32_t size) {
  if (is_reading_key_) return set_key({text, size});
  return is_value_of(kChannel) && size <= kChannelNameMax;
}

bool FrameVisitor::visit_bin(const char* data, std::uint32_t size) {
  if (!is_value_of(kData) || size > CanFrame::kBytesMax) return false;
  std::memcpy(frame_.data.data(), data, size);
  data_size_ = size;
  return true;
}

std::optional<CanFrame> FrameVisitor::frame() const {
  if (keys_seen_ != (1U << kNumKeys) - 1) return std::nullopt;
  if (data_size_ != (frame_.has(CanFrame::kRemote) ? 0 : dlc_)) return std::nullopt;
  CanFrame frame = frame_;
  frame.num_bytes = static_cast<std::uint8_t>(dlc_);
  // python-can marks error frames as extended, as their identifier has 29 bits.
  if (frame.has(CanFrame::kError)) frame.flags &= static_cast<std::uint8_t>(~CanFrame::kExtended);
  return is_valid(frame) ? std::optional(frame) : std::nullopt;
}

}  // namespace

std::size_t pack_udp_frame(const CanFrame& frame, double timestamp_s,
                           std::span<std::uint8_t> bytes) {
  if (!is_valid(frame) || frame.has(CanFrame::kError)) return 0;
  SlotWriter writer{bytes};
  msgpack::packer<SlotWriter> packer(writer);
  const auto pack_flag = [&](Key key, CanFrame::Flag flag) {
    pack_text(packer, kKeyNames[key]);
    packer.pack(frame.has(flag));
  };
  packer.pack_map(kNumKeys);
  pack_text(packer, kKeyNames[kTimestamp]);
  packer.pack_double(timestamp_s);
  pack_text(packer, kKeyNames[kArbitrationId]);
  packer.pack(frame.identifier);
  pack_flag(kIsExtendedId, CanFrame::kExtended);
  pack_flag(kIsRemoteFrame, CanFrame::kRemote);
  pack_flag(kIsErrorFrame, CanFrame::kError);
  pack_text(packer, kKeyNames[kChannel]);
  packer.pack_nil();
  pack_text(packer, kKeyNames[kDlc]);
  packer.pack(std::uint32_t{frame.num_bytes});
  pack_text(packer, kKeyNames[kData]);
  packer.pack_bin(static_cast<std::uint32_t>(frame.bytes().size()));
  for (const std::uint8_t byte : frame.bytes()) {
    packer.pack_bin_body(reinterpret_cast<const char*>(&byte), 1);
  }
  pack_flag(kIsFd, CanFrame::kFd);
  pack_flag(kBitrateSwitch, CanFrame::kBitRateSwitch);
  pack_flag(kErrorStateIndicator, CanFrame::kErrorStateIndicator);
  return writer.num_written;
}

std::optional<CanFrame> unpack_udp_frame(std::span<const std::uint8_t> bytes) {
  if (bytes.empty()) return std::nullopt;
  FrameVisitor visitor;
  std::size_t end = 0;
  try {
    const char* const text = reinterpret_cast<const char*>(bytes.data());
    if (!msgpack::parse(text, bytes.size(), end, visitor)) return std::nullopt;
  } catch (const std::exception&) {
    return std::nullopt;  // the parser throws for some lengths that overflow
  }
  if (end != bytes.size()) return std::nullopt;
  return visitor.frame();
}

}  // namespace holdfast
