#pragma once

#include <vector>

namespace holdfast {

/// Which symmetric set of sigma points: kappa and beta of Julier and Uhlmann (1997), with alpha
/// = 1. The weights are positive when kappa is, so that moments stay positive semidefinite.
struct SigmaRule {
  double kappa = 1.0, beta = 0.0;

  /// The unscented set of the method's page, and the cubature set (Arasaratnam and Haykin 2009),
  /// whose point at the mean has no weight.
  static constexpr SigmaRule unscented() { return {0.5, 2.0}; }
  static constexpr SigmaRule cubature() { return {0.0, 0.0}; }
};

/// How a filter takes moments through a nonlinear function; all are the same for a linear one.
enum class Linearisation {
  kExtended,   // first order about the mean
  kUnscented,  // SigmaRule::unscented()
  kCubature    // SigmaRule::cubature()
};

/// Symmetric sigma points of a Gaussian; exact for linear functions.
///
///   z_0 = mean, z_{2i+1}, z_{2i+2} = mean +- sqrt(d + kappa) u_i;   u_i: rows of U, P = U'U
///   w_0 = kappa / (d + kappa), others 1 / (2 (d + kappa)); w_0 + beta for second moments
class SigmaPoints {
 public:
  /// Precondition: kappa >= 0.
  explicit SigmaPoints(SigmaRule rule = {}) : rule_(rule) {}

  /// Points of the leading block of this size; rows of the covariance are `width` long. A direction
  /// without variance gives points at the mean.
  void set(const double* mean, const double* covariance, int width, int size);

  int count() const { return 2 * size_ + 1; }
  int size() const { return size_; }
  const double* point(int i) const { return points_.data() + i * size_; }
  double weight(int i) const { return (i == 0 ? rule_.kappa : 0.5) / (size_ + rule_.kappa); }
  double covariance_weight(int i) const { return weight(i) + (i == 0 ? rule_.beta : 0.0); }

 private:
  SigmaRule rule_;
  int size_ = 0;
  std::vector<double> points_, factor_, reciprocals_;
};

}  // namespace holdfast
