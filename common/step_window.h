#pragma once

#include <cstdint>
#include <limits>

#include "common/configuration.h"

namespace holdfast {

/// When something acts: steps and model time, both ends included, both conditions to be met.
struct StepWindow {
  /// Largest step that a random stream can address; stands for "to the end".
  static constexpr std::int64_t kLastStep = std::numeric_limits<std::uint32_t>::max();

  std::int64_t first_step = 1;
  std::int64_t last_step = kLastStep;
  double from_s = 0.0;
  double to_s = std::numeric_limits<double>::infinity();

  /// True when step k, whose model time is k step_s, lies in the window.
  bool contains(std::int64_t step, double step_s) const;
  /// First step that lies in it, at step_s of model time each.
  std::int64_t first(double step_s) const;
  /// Keys first_step, last_step, from_s, to_s.
  void read(ConfigurationMap map);
};

}  // namespace holdfast
