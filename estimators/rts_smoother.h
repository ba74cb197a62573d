#pragma once

#include <cstddef>
#include <vector>

#include "estimators/gaussian_update.h"
#include "estimators/small_factor.h"
#include "estimators/small_matrix.h"
#include "estimators/small_product.h"

namespace holdfast {

/// What one step of a filter leaves for its smoother.
template <int N>
struct SmoothingStep {
  Small<N, N> cross;              // Cov[x_{k-1}, x_k | y_1 .. y_{k-1}], of the prediction to k
  Belief<N> predicted, filtered;  // x_k before and after y_k
};

/// Rauch-Tung-Striebel step from k + 1 back to k: gain G = cross P_{k+1|k}^-1, mean
/// m + G (m_s - m_{k+1|k}), covariance P + G (P_s - P_{k+1|k}) G'. False, and the filtered belief
/// as it was, when P_{k+1|k} is not positive definite.
template <int N>
[[gnu::flatten]] bool smooth_back(const SmoothingStep<N>& next, const Belief<N>& next_smoothed,
                                  const Belief<N>& filtered, Belief<N>& smoothed) {
  SmallFactor<N> factor;
  if (!factor.factorise(next.predicted.covariance)) {
    smoothed = filtered;
    return false;
  }
  Small<N, N> gain, gained;
  gain = next.cross;  // whole vectors, which a copy made at once would not be
  factor.solve_right(gain);
  const Small<N> shift = next_smoothed.mean - next.predicted.mean;
  add_product(filtered.mean, gain, shift, smoothed.mean);
  const Small<N, N> change = next_smoothed.covariance - next.predicted.covariance;
  multiply(gain, change, gained);
  add_transposed_symmetric(filtered.covariance, gained, gain, smoothed.covariance);
  return true;
}

/// Fixed-interval smoothing of `count` consecutive steps, step_at(i) -> const SmoothingStep<N>&.
/// Returns at how many steps the chain broke and began anew from the filtered belief.
template <int N, class StepAt>
int smooth_interval(std::size_t count, const StepAt& step_at, std::vector<Belief<N>>& smoothed) {
  int num_breaks = 0;
  smoothed.resize(count);
  for (std::size_t k = count; k-- > 0;) {
    const SmoothingStep<N>& step = step_at(k);
    if (k + 1 == count) {
      smoothed[k] = step.filtered;
    } else if (!smooth_back(step_at(k + 1), smoothed[k + 1], step.filtered, smoothed[k])) {
      ++num_breaks;
    }
  }
  return num_breaks;
}

}  // namespace holdfast
