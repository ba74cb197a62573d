#pragma once

#include <cstddef>
#include <functional>

#include "estimators/smoothing_estimator.h"

namespace holdfast {

/// Hands out the smoothed estimate of each step once and in order: `lag_steps` later, and what is
/// left at the end; with lag 0 all at the end, by everything that ever arrived.
class SmoothedStream {
 public:
  using OnEstimate = std::function<void(const Estimate&)>;

  /// The estimator must not have taken a step yet. Precondition: lag_steps >= 0.
  SmoothedStream(SmoothingEstimator& estimator, std::size_t lag_steps)
      : estimator_(estimator), lag_steps_(lag_steps) {
    estimator_.remember(lag_steps > 0 ? lag_steps + 1 : SmoothingEstimator::kAllSteps);
  }

  /// After each step of the estimator.
  void on_step(const OnEstimate& on_estimate) {
    ++num_steps_;
    if (lag_steps_ > 0 && num_steps_ > lag_steps_) on_estimate(estimator_.smooth().front());
  }

  /// After the last step.
  void finish(const OnEstimate& on_estimate) {
    if (num_steps_ == 0) return;
    const std::vector<Estimate>& all = estimator_.smooth();
    const bool is_first_out = lag_steps_ > 0 && num_steps_ > lag_steps_;
    for (std::size_t i = is_first_out ? 1 : 0; i < all.size(); ++i) on_estimate(all[i]);
  }

 private:
  SmoothingEstimator& estimator_;
  std::size_t lag_steps_;
  std::size_t num_steps_ = 0;
};

}  // namespace holdfast
