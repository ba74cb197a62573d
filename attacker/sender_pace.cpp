#include "attacker/sender_pace.h"

#include <cmath>

namespace holdfast {
namespace {

constexpr double kRounding = 1e-9;

}  // namespace

void SenderPace::learn(std::int64_t step, const CanFrame& frame) {
  const bool is_new_step = num_steps_ == 0 || step != last_step_;
  if (num_steps_ > 0 && is_new_step && !is_silenced_) {
    ++num_gaps_;
    sum_of_gaps_ += step - last_step_;
  }
  if (is_new_step) ++num_steps_;
  ++num_frames_;
  last_step_ = step;
  latest_ = frame;
  is_silenced_ = false;
}

int SenderPace::due(std::int64_t step) {
  if (num_gaps_ == 0) return 0;
  const double distance = static_cast<double>(sum_of_gaps_) / static_cast<double>(num_gaps_);
  const double in_each = static_cast<double>(num_frames_) / static_cast<double>(num_steps_);
  const auto now = static_cast<double>(step);
  if (!is_silenced_) {
    is_silenced_ = true;
    credit_ = 0.0;
    next_ = static_cast<double>(last_step_) + distance;
    // Keeps the beat: the first of its times that is not past.
    if (next_ < now - kRounding)
      next_ += distance * std::ceil((now - kRounding - next_) / distance);
  }
  for (; next_ <= now + kRounding; next_ += distance) credit_ += in_each;
  const double whole = std::floor(credit_ + kRounding);
  credit_ -= whole;
  return static_cast<int>(whole);
}

}  // namespace holdfast
