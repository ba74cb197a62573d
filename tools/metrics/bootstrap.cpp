#include "tools/metrics/bootstrap.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "common/random_stream.h"

namespace holdfast {
namespace {

using Row = Eigen::Map<const Eigen::ArrayXd>;

// Sums over runs in their order. Steps are summed side by side, so that the order of the sum does
// not depend on the width of the machine's registers.
void add_weighted(const RunMatrix& matrix, std::span<const RunBootstrap::Weight> weights,
                  std::span<double> sums) {
  const auto num_steps = static_cast<Eigen::Index>(matrix.num_steps());
  Eigen::Map<Eigen::ArrayXd> sum(sums.data(), num_steps);
  sum.setZero();
  for (std::size_t r = 0; r < matrix.num_runs(); ++r) {
    if (weights[r] == 0) continue;
    sum += static_cast<double>(weights[r]) * Row(matrix.run(r).data(), num_steps);
  }
}

}  // namespace

RunBootstrap::RunBootstrap(std::int64_t seed, std::size_t num_runs, std::size_t num_resamples)
    : num_runs_(num_runs), num_resamples_(num_resamples), weights_(num_runs * num_resamples, 0) {
  const RandomStream draws(static_cast<std::uint64_t>(seed), 0, "campaign/bootstrap");
  for (std::size_t resample = 0; resample < num_resamples; ++resample) {
    Weight* weights = weights_.data() + resample * num_runs;
    for (std::size_t i = 0; i < num_runs; ++i) {
      const double position =
          draws.uniform(static_cast<std::uint32_t>(resample), i) * static_cast<double>(num_runs);
      ++weights[std::min(static_cast<std::size_t>(position), num_runs - 1)];
    }
  }
}

double bootstrap_error(std::span<const double> resampled) {
  double sum = 0.0, count = 0.0, squares = 0.0;
  for (const double value : resampled) {
    if (std::isnan(value)) continue;
    sum += value;
    count += 1.0;
  }
  const double mean = sum / count;
  for (const double value : resampled) {
    if (!std::isnan(value)) squares += (value - mean) * (value - mean);
  }
  return std::sqrt(squares / count);
}

StepMeans::StepMeans(const RunMatrix& matrix) : matrix_(&matrix), counts_(matrix.num_steps()) {
  bool is_complete = true;
  for (std::size_t r = 0; r < matrix.num_runs(); ++r) {
    const auto run = matrix.run(r);
    const auto missing =
        std::count_if(run.begin(), run.end(), [](double value) { return std::isnan(value); });
    is_complete = is_complete && missing == 0;
    num_runs_with_values_ += missing < static_cast<std::ptrdiff_t>(run.size()) ? 1 : 0;
  }
  if (is_complete) return;
  filled_ = matrix;
  is_present_ = RunMatrix(matrix.num_runs(), matrix.num_steps(), 1.0);
  for (std::size_t r = 0; r < matrix.num_runs(); ++r) {
    for (std::size_t k = 0; k < matrix.num_steps(); ++k) {
      if (!std::isnan(filled_.run(r)[k])) continue;
      filled_.run(r)[k] = 0.0;
      is_present_.run(r)[k] = 0.0;
    }
  }
  matrix_ = &filled_;
}

void StepMeans::mean(std::span<const RunBootstrap::Weight> weights, std::span<double> means) {
  add_weighted(*matrix_, weights, means);
  if (is_present_.num_runs() > 0) {
    add_weighted(is_present_, weights, counts_);
  } else {
    double total = 0.0;
    for (const RunBootstrap::Weight weight : weights) total += weight;
    std::fill(counts_.begin(), counts_.end(), total);
  }
  // 0 / 0 is the NaN of a step without values.
  for (std::size_t k = 0; k < means.size(); ++k) means[k] /= counts_[k];
}

std::vector<double> StepMeans::mean() {
  std::vector<double> means(matrix_->num_steps());
  mean(std::vector<RunBootstrap::Weight>(matrix_->num_runs(), 1), means);
  return means;
}

}  // namespace holdfast
