#pragma once

#include <vector>

namespace holdfast {

/// Symmetric sigma points of a Gaussian (Julier and Uhlmann 1997), with kappa = 1: all weights are
/// positive, so that moments stay positive semidefinite. Exact for linear functions.
///
///   z_0 = mean, z_{2i+1}, z_{2i+2} = mean +- sqrt(d + 1) u_i;   u_i: rows of U, P = U'U
///   w_0 = 1 / (d + 1), others 1 / (2 (d + 1))
class SigmaPoints {
 public:
  /// Points of the leading block of this size; rows of the covariance are `width` long. A direction
  /// without variance gives points at the mean.
  void set(const double* mean, const double* covariance, int width, int size);

  int count() const { return 2 * size_ + 1; }
  int size() const { return size_; }
  const double* point(int i) const { return points_.data() + i * size_; }
  double weight(int i) const { return (i == 0 ? 1.0 : 0.5) / (size_ + 1.0); }

 private:
  int size_ = 0;
  std::vector<double> points_, factor_, reciprocals_;
};

}  // namespace holdfast
