#include "tools/metrics/bootstrap.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "common/random_stream.h"

namespace holdfast {
namespace {

using Row = Eigen::Map<const Eigen::ArrayXd>;

// Few enough that their sums stay in the processor's nearest cache while each run is read once for
// all of them.
constexpr std::size_t kTogether = 8;

using Weights = std::span<const RunBootstrap::Weight>;

// Sums over runs in their order, a row for each set of weights. Steps are summed side by side, so
// that the order of the sum does not depend on the width of the machine's registers.
void add_weighted(const RunMatrix& matrix, std::span<const Weights> weights,
                  std::vector<double>& sums) {
  const std::size_t num_steps = matrix.num_steps();
  const auto size = static_cast<Eigen::Index>(num_steps);
  sums.assign(weights.size() * num_steps, 0.0);
  for (std::size_t r = 0; r < matrix.num_runs(); ++r) {
    const Row row(matrix.run(r).data(), size);
    for (std::size_t i = 0; i < weights.size(); ++i) {
      if (weights[i][r] == 0) continue;
      Eigen::Map<Eigen::ArrayXd>(sums.data() + i * num_steps, size) +=
          static_cast<double>(weights[i][r]) * row;
    }
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

StepMeans::StepMeans(const RunMatrix& matrix) : matrix_(&matrix) {
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

void StepMeans::compute(std::span<const Weights> weights) {
  const std::size_t num_steps = matrix_->num_steps();
  add_weighted(*matrix_, weights, means_);
  if (is_present_.num_runs() > 0) {
    add_weighted(is_present_, weights, counts_);
  } else {
    counts_.resize(means_.size());
    for (std::size_t i = 0; i < weights.size(); ++i) {
      double total = 0.0;
      for (const RunBootstrap::Weight weight : weights[i]) total += weight;
      std::fill_n(counts_.begin() + static_cast<std::ptrdiff_t>(i * num_steps), num_steps, total);
    }
  }
  // 0 / 0 is the NaN of a step without values.
  for (std::size_t k = 0; k < means_.size(); ++k) means_[k] /= counts_[k];
}

void StepMeans::for_each_resample(const RunBootstrap& bootstrap,
                                  const std::function<void(std::span<const double>)>& take) {
  const std::size_t num_steps = matrix_->num_steps();
  std::vector<Weights> weights;
  for (std::size_t first = 0; first < bootstrap.num_resamples(); first += kTogether) {
    weights.clear();
    const std::size_t end = std::min(first + kTogether, bootstrap.num_resamples());
    for (std::size_t i = first; i < end; ++i) weights.push_back(bootstrap.weights(i));
    compute(weights);
    for (std::size_t i = 0; i < weights.size(); ++i)
      take(std::span(means_).subspan(i * num_steps, num_steps));
  }
}

std::vector<double> StepMeans::mean() {
  const std::vector<RunBootstrap::Weight> once(matrix_->num_runs(), 1);
  const Weights weights = once;
  compute(std::span(&weights, 1));
  return means_;
}

}  // namespace holdfast
