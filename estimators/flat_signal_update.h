#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <vector>

#include "common/models/system_model.h"
#include "estimators/gaussian_mixture.h"

namespace holdfast {

/// Joint update of state and signal by rows of y, with no prior of the signal: eqs. (101)-(109) of
/// paper 000, the joint input and state estimator. Linear models.
///
///   S = C Px C' + R,  e = L^-1 (y - C x_pred),  V = L^-1 C Px,  E = L^-1 H,  Lambda = E'E = Lc Lc'
///   a = Lambda^-1 E'e,   x = x_pred + V'(e - E a),
///   log q = -(|e|^2 - |Lc^-1 E'e|^2 + (l - m) log 2 pi) / 2 - log |L| - log |Lc|
///
/// Delayed: x - G a and C G stand for x and H, for the signal of the step before. The component
/// holds z = [x; a]; its a only tells, when delayed, what x owes to it.
class FlatSignalUpdate {
 public:
  struct Factor {
    Eigen::LLT<Eigen::MatrixXd> S, lambda;
    Eigen::MatrixXd V, E, G;     // [l x n], [l x m]; G = Lc^-1 E' [m x l]
    Eigen::MatrixXd covariance;  // posterior of z
    double log_norm = 0.0;
    bool is_valid = false;
  };

  /// Throws UsageError when the rows do not show the whole signal: rank H (or C G) < m.
  FlatSignalUpdate(const SystemModel& model, const std::vector<int>& rows, bool is_delayed);

  void factorise(const GaussianMixture::ConstCovariance& P, Factor& factor);
  /// C x_pred of the component's mean z [n + m]; y [l].
  void predict(const double* z, Eigen::Ref<Eigen::VectorXd> y);
  /// Whitens columns in place and takes out what some signal explains: (I - G'G) L^-1 residuals.
  void project(const Factor& factor, Eigen::Ref<GaussianMixture::RowMajor> residuals);
  /// Posterior mean of z for y - C x_pred, which is overwritten.
  void correct(const Factor& factor, const double* z, Eigen::VectorXd& residual, double* corrected);

 private:
  Eigen::MatrixXd C_, H_, R_, signal_gain_;  // signal_gain_: G when delayed, else zero
  // Scratch.
  Eigen::MatrixXd Px_, CP_, S_, lambda_, Paa_, Pxa_, transform_, explained_;
  Eigen::VectorXd x_, a_;
  std::vector<double> projected_;  // of as many columns as there are packets
};

}  // namespace holdfast
