#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/models/system_model.h"
#include "estimators/hybrid_bernoulli_options.h"
#include "estimators/sigma_points.h"

namespace holdfast {

/// What some rows of y say of one Gaussian of z = [x; a; ..]: the predicted measurement with its
/// covariances, exactly when the model is linear, else by linearisation at the mean (extended) or
/// by sigma points (unscented).
///
///   y = h(x, a) + v:   y_pred [l],   T = cov(y, z) = C~ P [l x d],   S = C~ P C~' + R [l x l]
///
/// C~ = [C H 0] when the signal is observed, else [C 0]. Matrices are row-major with padded rows.
class ComponentObservation {
 public:
  /// rows: of y; observes_signal: whether a stands in z behind x and enters y.
  ComponentObservation(const SystemModel& model, const std::vector<int>& rows, bool observes_signal,
                       HybridBernoulliOptions::Update update);

  bool is_linear() const { return model_.is_linear(); }
  int size() const { return static_cast<int>(rows_.size()); }
  /// The predicted measurement of a linear model; [size, padded].
  void predict(const double* mean, double* y) const;
  /// All three; S is valid on and above its diagonal and has rows of the padded width of size(), T
  /// of the component's width.
  void predict(const double* mean, const double* covariance, int width, int dimension, double* y,
               double* S, double* T);

 private:
  void load(const double* z);
  void linearise(const double* mean);
  void set_row(int i, const Eigen::MatrixXd& jacobian);
  void predict_points(const double* mean, const double* covariance, int width, int dimension,
                      double* y, double* S, double* T);

  SystemModel model_;
  std::vector<int> rows_;
  bool observes_signal_, is_unscented_;
  int inner_;                                 // of z that y sees
  std::vector<double> C_, C_transposed_, R_;  // C~ [l x inner], its transpose, R of the rows
  Eigen::MatrixXd jacobian_;
  Eigen::VectorXd x_, a_, y_;
  SigmaPoints points_;
  std::vector<double> seen_, offset_;
};

}  // namespace holdfast
