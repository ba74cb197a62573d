#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "drivers/can/frame_codec.h"

namespace holdfast {

/// What simulated sensors send: a message for each reading, or what sensors that keep a state say
/// of themselves; then the tick. Pure.
class ReadingEncoder {
 public:
  /// The codec must outlive it.
  explicit ReadingEncoder(const FrameCodec& codec)
      : codec_(codec), twins_(codec.make_sensor_twins()) {}

  /// Appends the frames of a step. readings[i]: of source i.
  void encode(std::int64_t step, const std::vector<std::vector<double>>& readings,
              std::vector<CanFrame>& frames) {
    if (twins_) {
      twins_->step(step, readings, frames);
    } else {
      for (std::size_t source = 0; source < readings.size(); ++source)
        frames.push_back(codec_.encode(static_cast<int>(source), readings[source], step));
    }
    frames.push_back(codec_.encode_tick(step));
  }
  /// Takes what somebody tells the sensors; heeded from the next step on.
  void on_frame(const CanFrame& frame) {
    if (twins_) twins_->on_frame(frame);
  }

 private:
  const FrameCodec& codec_;
  std::optional<SensorTwins> twins_;
};

}  // namespace holdfast
