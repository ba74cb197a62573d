#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace holdfast {

/// Values of one quantity over runs and steps; NaN where a run has none for that step.
class RunMatrix {
 public:
  RunMatrix() = default;
  RunMatrix(std::size_t num_runs, std::size_t num_steps, double value)
      : num_runs_(num_runs), num_steps_(num_steps), values_(num_runs * num_steps, value) {}

  std::size_t num_runs() const { return num_runs_; }
  std::size_t num_steps() const { return num_steps_; }
  std::span<double> run(std::size_t i) { return {values_.data() + i * num_steps_, num_steps_}; }
  std::span<const double> run(std::size_t i) const {
    return {values_.data() + i * num_steps_, num_steps_};
  }

 private:
  std::size_t num_runs_ = 0, num_steps_ = 0;
  std::vector<double> values_;
};

}  // namespace holdfast
