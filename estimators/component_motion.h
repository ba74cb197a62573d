#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/models/system_model.h"
#include "estimators/hybrid_bernoulli_options.h"
#include "estimators/sigma_points.h"

namespace holdfast {

/// What the attack signal does while a Gaussian of [x; a] moves by one step.
enum class Signal {
  kNone,   // x+ = f(x, 0)
  kMoves,  // x+ = f(x, a)
  kKept    // [x+; a] = [f(x, a); a]
};

/// Moves one Gaussian by the plant's dynamics: exactly when linear, else by linearisation at its
/// mean (extended) or by sigma points (unscented, 2 d + 1 points).
///
///   mean+ = f(mean),  P+ = F P F' + Q      F: Jacobian of f by [x; a]
///
/// Matrices are row-major with padded rows (padded_matrix.h).
class ComponentMotion {
 public:
  ComponentMotion(const SystemModel& model, HybridBernoulliOptions::Update update);

  /// Whether the covariance moves in the same way whatever the mean.
  bool is_linear() const { return model_.is_linear(); }
  int dimension(Signal signal) const {
    return num_states_ + (signal == Signal::kKept ? num_channels_ : 0);
  }
  /// mean and covariance start with [x; a], or x for kNone; width: of the covariance's rows.
  /// Results [dimension(signal)], rows of their own padded width. Null covariance: the mean only,
  /// linear.
  void move(const double* mean, const double* covariance, int width, Signal signal,
            double* next_mean, double* next_covariance);

 private:
  void load(const double* mean, int size);
  void add_noise(double* next_covariance, int width) const;
  void move_linearly(const double* mean, const double* covariance, int width, Signal signal,
                     double* next_mean, double* next_covariance);
  void linearise(const double* mean, Signal signal);
  void move_points(const double* mean, const double* covariance, int width, Signal signal,
                   double* next_mean, double* next_covariance);

  SystemModel model_;
  bool is_unscented_;
  int num_states_, num_channels_;
  // Jacobian [x+; a] by [x; a] and its transpose, rows padded to the width of n + m.
  std::vector<double> F_, F_transposed_, product_;
  Eigen::MatrixXd jacobian_;
  Eigen::VectorXd x_, a_, next_;
  SigmaPoints points_;
  std::vector<double> moved_;  // per point, [x+; a]
};

}  // namespace holdfast
