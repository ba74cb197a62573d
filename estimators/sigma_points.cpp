#include "estimators/sigma_points.h"

#include <algorithm>
#include <cmath>

#include "estimators/padded_matrix.h"

namespace holdfast {

void SigmaPoints::set(const double* mean, const double* covariance, int width, int size) {
  size_ = size;
  const int own_width = padded::width_of(size);
  factor_.assign(static_cast<std::size_t>(size * own_width), 0.0);
  reciprocals_.resize(static_cast<std::size_t>(size));
  points_.resize(static_cast<std::size_t>(count() * size));
  for (int i = 0; i < size; ++i) {
    std::copy_n(covariance + i * width, size, factor_.data() + i * own_width);
  }
  padded::factorise(factor_.data(), own_width, size, reciprocals_.data(),
                    padded::Pivots::kNonNegative);
  const double spread = std::sqrt(size + rule_.kappa);
  std::copy_n(mean, size, points_.data());
  for (int i = 0; i < size; ++i) {
    double* const above = points_.data() + (2 * i + 1) * size;
    double* const below = above + size;
    const double* const row = factor_.data() + i * own_width;
    for (int j = 0; j < size; ++j) {
      const double offset = j < i ? 0.0 : spread * row[j];
      above[j] = mean[j] + offset;
      below[j] = mean[j] - offset;
    }
  }
}

}  // namespace holdfast
