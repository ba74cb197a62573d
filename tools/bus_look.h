#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "drivers/can/can_frame.h"
#include "drivers/can/dbc.h"

namespace holdfast {

/// What arrives on a bus that nobody has described: its identifiers, how often each comes, what a
/// DBC, CANopen or J1939 makes of it, and which bits change. Pure; its memory is bounded.
class BusLook {
 public:
  static constexpr std::size_t kIdentifiersMax = 4096;

  explicit BusLook(Dbc dbc = {}) : dbc_(std::move(dbc)) {}

  void on_frame(const CanFrame& frame, std::int64_t time_ns);
  std::int64_t num_frames() const { return num_frames_; }
  /// A table for people, and behind it lines for network.sensors: candidates for binary sensors.
  std::string text() const;

 private:
  struct Seen {
    CanFrame latest;
    std::int64_t count = 0, first_ns = 0, last_ns = 0;
    std::array<std::uint8_t, CanFrame::kBytesMax> changed{};  // bits that were not always the same
  };
  std::string meaning_of(const Seen& seen) const;
  std::string sensors_of(const Seen& seen) const;

  Dbc dbc_;
  std::map<std::uint64_t, Seen> seen_;  // by frame_key(), of a switch bank by its instance, too
  std::int64_t num_frames_ = 0, num_left_out_ = 0;
};

}  // namespace holdfast
