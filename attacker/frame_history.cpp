#include "attacker/frame_history.h"

#include <algorithm>

namespace holdfast {

void FrameHistory::reach_back(int num_steps) {
  const auto length = static_cast<std::size_t>(num_steps) + 1;
  if (frames_.size() >= length) return;
  frames_.resize(length);
  steps_.assign(length, 0);
}

void FrameHistory::take_over(const FrameHistory& other) {
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < other.steps_.size(); ++i) {
    if (other.steps_[i] > 0) places.push_back(i);
  }
  // Later steps take the places of earlier ones, as they would have.
  std::ranges::sort(places, {}, [&other](std::size_t i) { return other.steps_[i]; });
  for (const std::size_t i : places) remember(other.steps_[i], other.frames_[i]);
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
