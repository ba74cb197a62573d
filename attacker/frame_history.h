#pragma once

#include <cstdint>
#include <vector>

#include "drivers/can/can_frame.h"

namespace holdfast {

/// Genuine frames of one identifier, the first of each step, for rules that replay them. The memory
/// is what the longest delay needs; a frame older than that is forgotten.
class FrameHistory {
 public:
  explicit FrameHistory(std::uint32_t key) : key_(key) {}

  std::uint32_t key() const { return key_; }
  /// Keeps frames for this many steps back, at least. Forgets what was kept.
  void reach_back(int num_steps);
  /// Remembers what another one does, as far as it reaches.
  void take_over(const FrameHistory& other);
  void remember(std::int64_t step, const CanFrame& frame);
  /// The frame of that step; null when none came or it is forgotten.
  const CanFrame* find(std::int64_t step) const;

 private:
  std::uint32_t key_;
  std::vector<CanFrame> frames_;     // ring, by step
  std::vector<std::int64_t> steps_;  // to which a place belongs, 0: none
};

}  // namespace holdfast
