#pragma once

#include <cstdint>
#include <vector>

#include "common/random_stream.h"

namespace holdfast::testing {

/// What so many binary sensors see in a step: 0 or 1 each, the same for the same step.
inline std::vector<std::vector<double>> random_readings(std::size_t num_sensors,
                                                        std::int64_t step) {
  const RandomStream stream(3, 0, "test/sensors");
  std::vector<std::vector<double>> readings;
  for (std::uint64_t i = 0; i < num_sensors; ++i)
    readings.push_back({stream.uniform(static_cast<std::uint32_t>(step), i) < 0.5 ? 0.0 : 1.0});
  return readings;
}

}  // namespace holdfast::testing
