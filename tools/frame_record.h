#pragma once

#include <holdfast/can_frames_t.hpp>
#include <string>

#include "common/lcm_link.h"
#include "drivers/can/can_frame.h"

namespace holdfast {

/// Publishes the frames of one side of the proxy in batches: CAN_RX what the driver read, CAN_TX
/// what the attacker sent. The review aligns the two.
class FrameRecord {
 public:
  FrameRecord(LcmLink& link, const std::string& channel, const std::string& bus_url, double step_s);

  /// Appends the next frame of the bus; a full batch is published at once.
  void add(const CanFrame& frame, std::int64_t step);
  /// Publishes what has gathered, if anything.
  void flush(std::int64_t step);

 private:
  LcmLink& link_;
  std::string channel_;
  double step_s_;
  std::int64_t next_index_ = 0;
  can_frames_t message_;
};

}  // namespace holdfast
