#include "tools/frame_record.h"

#include <cmath>

#include "drivers/can/can_messages.h"

namespace holdfast {
namespace {

// 256 classic frames are some 10 kB; a message stays far below LCM's limits even with FD frames.
constexpr std::size_t kBatchMax = 256;

}  // namespace

FrameRecord::FrameRecord(LcmLink& link, const std::string& channel, const std::string& bus_url,
                         double step_s)
    : link_(link), channel_(channel), step_s_(step_s) {
  message_.bus = bus_url;
}

void FrameRecord::add(const CanFrame& frame, std::int64_t step) {
  to_message(frame, next_index_++, message_.frames.emplace_back());
  if (message_.frames.size() >= kBatchMax) flush(step);
}

void FrameRecord::flush(std::int64_t step) {
  if (message_.frames.empty()) return;
  message_.step = step;
  message_.utime = std::llround(static_cast<double>(step) * step_s_ * 1e6);
  message_.num_frames = static_cast<std::int32_t>(message_.frames.size());
  link_.publish(channel_, message_);
  message_.frames.clear();
}

}  // namespace holdfast
