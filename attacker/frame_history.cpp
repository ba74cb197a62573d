#include "attacker/frame_history.h"

namespace holdfast {

void FrameHistory::reach_back(int num_steps) {
  const auto length = static_cast<std::size_t>(num_steps) + 1;
  if (frames_.size() >= length) return;
  frames_.resize(length);
  steps_.assign(length, 0);
}

void FrameHistory::remember(std::int64_t step, const CanFrame& frame) {
  const std::size_t place = static_cast<std::size_t>(step) % frames_.size();
  if (steps_[place] == step) return;
  frames_[place] = frame;
  steps_[place] = step;
}

const CanFrame* FrameHistory::find(std::int64_t step) const {
  if (step < 1) return nullptr;
  const std::size_t place = static_cast<std::size_t>(step) % frames_.size();
  return steps_[place] == step ? &frames_[place] : nullptr;
}

}  // namespace holdfast
