#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

namespace holdfast {

class can_frame_t;
class attack_frame_t;

/// Where a frame on the monitor-side bus came from.
enum class PacketLabel {
  kAuthentic,  // sent by the proxy as it was read from the sensor side
  kAltered,    // sent by the proxy, changed by a rule
  kInjected,   // made by a rule
  kForeign,    // never sent by the proxy: somebody else wrote it to the bus
  kUnknown     // what the proxy sent at that time is not in the log
};
inline constexpr PacketLabel kPacketLabels[] = {PacketLabel::kAuthentic, PacketLabel::kAltered,
                                                PacketLabel::kInjected, PacketLabel::kForeign,
                                                PacketLabel::kUnknown};

const char* to_string(PacketLabel label);

/// Pairs two sequences of which the second is the first with some elements lost and others put in.
///
/// The pairing keeps order and is a longest common subsequence where the search can afford it; long
/// sequences are first cut at elements that stand once in both (ticks, stamped frames). Result: for
/// each element of `received` the index of its partner in `sent`, or -1.
std::vector<std::int64_t> align_frames(std::span<const std::int32_t> sent,
                                       std::span<const std::int32_t> received);

struct LabelledFrame {
  PacketLabel label = PacketLabel::kUnknown;
  std::int64_t tx_index = -1;  // nth frame that the proxy sent, -1 when it did not send this one
  std::string rule;            // that touched it, empty when none
};

/// Labels of every frame that the driver read.
struct FrameLabels {
  std::unordered_map<std::int64_t, LabelledFrame> by_rx_index;
  std::map<PacketLabel, std::int64_t> count;
  std::int64_t lost = 0;          // sent by the proxy, never read by the driver
  std::int64_t lost_unknown = 0;  // the same, but the log does not hold all that the driver read
  bool has_sent = false;          // the log holds what the proxy sent (CAN_TX)

  LabelledFrame find(std::int64_t rx_index) const;
};

/// Joins what the driver read (CAN_RX) with what the proxy sent (CAN_TX) by the bytes of the
/// frames, then with the proxy's truth (ATTACK_FRAME) by tx_index. Frames are added in bus order.
class PacketLabeler {
 public:
  void add_received(const can_frame_t& frame);
  void add_sent(const can_frame_t& frame);
  void add_attack(const attack_frame_t& attack);

  std::int64_t num_received() const { return static_cast<std::int64_t>(received_.index.size()); }

  /// A sequence is complete when its writer ended in good order, so that nothing is missing after
  /// its last frame. Holes inside are seen by the frames' own indices.
  FrameLabels labels(bool received_is_complete, bool sent_is_complete) const;

 private:
  struct Sequence {
    std::vector<std::int64_t> index;  // the frames' own
    std::vector<std::int32_t> key;    // equal keys: equal identifier, format and bytes
  };
  void add(const can_frame_t& frame, Sequence& sequence);

  Sequence received_, sent_;
  std::unordered_map<std::string, std::int32_t> key_of_;
  std::unordered_map<std::int64_t, LabelledFrame> touched_;  // by tx_index
};

}  // namespace holdfast
