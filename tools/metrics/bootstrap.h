#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "tools/metrics/run_matrix.h"

namespace holdfast {

/// Resamples of the runs, with replacement, each as large as the set of runs; the same for
/// everything that is resampled, so that what belongs together stays together.
///
/// Draw i of resample b is uniform draw i of step b of the stream "campaign/bootstrap" of the seed.
class RunBootstrap {
 public:
  using Weight = std::uint16_t;

  RunBootstrap(std::int64_t seed, std::size_t num_runs, std::size_t num_resamples);

  std::size_t num_runs() const { return num_runs_; }
  std::size_t num_resamples() const { return num_resamples_; }
  /// How often each run was drawn.
  std::span<const Weight> weights(std::size_t resample) const {
    return {weights_.data() + resample * num_runs_, num_runs_};
  }

 private:
  std::size_t num_runs_, num_resamples_;
  std::vector<Weight> weights_;  // [resample][run]
};

/// Standard deviation of a statistic over resamples; NaN are left out.
double bootstrap_error(std::span<const double> resampled);

/// Means over runs at each step, of all runs or of a resample, quickly.
class StepMeans {
 public:
  /// Keeps a reference to the matrix.
  explicit StepMeans(const RunMatrix& matrix);
  StepMeans(const StepMeans&) = delete;
  StepMeans& operator=(const StepMeans&) = delete;

  std::size_t num_runs_with_values() const { return num_runs_with_values_; }
  /// Means over the runs that have a value at the step, of each resample in turn; NaN where none
  /// has.
  void for_each_resample(const RunBootstrap& bootstrap,
                         const std::function<void(std::span<const double>)>& take);
  /// The same over all runs.
  std::vector<double> mean();

 private:
  void compute(std::span<const std::span<const RunBootstrap::Weight>> weights);

  const RunMatrix* matrix_;
  // Only when something is missing: the values with 0 for NaN, and 1 where there is a value.
  RunMatrix filled_, is_present_;
  std::size_t num_runs_with_values_ = 0;
  std::vector<double> means_, counts_;  // a row for each of the resamples that are summed at once
};

}  // namespace holdfast
