#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace holdfast {

/// Some steps of every run, for metrics of their own: "before the attack", "during it, where
/// nothing was lost".
struct MetricsWindow {
  std::string name;
  std::int64_t first_step = 1, last_step = 1;  // both included
  // Only steps in which an authentic packet arrived, and in so many steps before; -1: all steps.
  std::int64_t fresh_steps = -1;
  // Steps that are left out, first and last of each stretch.
  std::vector<std::pair<std::int64_t, std::int64_t>> without = {};
};

}  // namespace holdfast
