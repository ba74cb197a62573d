#pragma once

#include <cstdint>
#include <optional>

#include "drivers/can/can_frame.h"

namespace holdfast {

/// When a sender sends: the mean distance of the steps in which its frames came, and how many came
/// in each. Goes on counting where the sender was silenced.
class SenderPace {
 public:
  /// A genuine frame. Steps must not go back.
  void learn(std::int64_t step, const CanFrame& frame);
  /// How many frames it would send in this step; to be asked once in each step in which it is
  /// silenced. What it would have sent before the first of them is not made up for. 0 until frames
  /// of two steps were seen: there is no pace to keep.
  int due(std::int64_t step);
  /// The latest genuine frame; null before the first.
  const CanFrame* latest() const { return latest_ ? &*latest_ : nullptr; }

 private:
  std::optional<CanFrame> latest_;
  std::int64_t last_step_ = 0;
  std::int64_t num_steps_ = 0, num_frames_ = 0;  // in which frames came; frames
  std::int64_t num_gaps_ = 0, sum_of_gaps_ = 0;  // between such steps while it was not silenced
  double next_ = 0.0;                            // when the next ones are due; of a silenced sender
  double credit_ = 0.0;                          // parts of frames that are due
  bool is_silenced_ = false;
};

}  // namespace holdfast
