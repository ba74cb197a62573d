#include "attacker/sender_pace.h"

#include <cmath>

namespace holdfast {
namespace {

constexpr double kRounding = 1e-9;

}  // namespace

void SenderPace::learn(std::int64_t step, const CanFrame& frame) {
  if (num_steps_ == 0) first_step_ = step;
  if (num_steps_ == 0 || step != last_step_) ++num_steps_;
  ++num_frames_;
  last_step_ = step;
  latest_ = frame;
  is_silenced_ = false;
}

int SenderPace::due(std::int64_t step) {
  if (num_steps_ < 2) return 0;
  const double distance =
      static_cast<double>(last_step_ - first_step_) / static_cast<double>(num_steps_ - 1);
  const double in_each = static_cast<double>(num_frames_) / static_cast<double>(num_steps_);
  if (!is_silenced_) {
    is_silenced_ = true;
    next_ = static_cast<double>(last_step_) + distance;
    credit_ = 0.0;
  }
  for (; next_ <= static_cast<double>(step) + kRounding; next_ += distance) credit_ += in_each;
  const double whole = std::floor(credit_ + kRounding);
  credit_ -= whole;
  return static_cast<int>(whole);
}

}  // namespace holdfast
