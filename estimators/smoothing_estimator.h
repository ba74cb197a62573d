#pragma once

#include <cstddef>
#include <vector>

#include "estimators/estimator.h"

namespace holdfast {

/// An estimator that can look back: its past states given everything up to now.
class SmoothingEstimator : public Estimator {
 public:
  /// Keeps the latest steps from now on, at most this many; kAllSteps: all of them.
  virtual void remember(std::size_t num_steps) = 0;
  static constexpr std::size_t kAllSteps = static_cast<std::size_t>(-1);

  /// Smoothed estimates of all steps that are remembered, oldest first; the last one is the
  /// filter's own. The reference holds until the next call of any member.
  virtual const std::vector<Estimate>& smooth() = 0;
};

}  // namespace holdfast
