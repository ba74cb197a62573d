#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimators/baseline_options.h"
#include "estimators/estimator.h"
#include "estimators/kalman_core.h"
#include "estimators/vector_correction.h"

namespace holdfast {

/// How much the data say of an input beyond its prior N(a0, Pa).
///
/// With P_aa and a^ the posterior's, i = P_aa^-1 a^ - Pa^-1 a0 is what the data add. The score is
/// P(chi-square with m degrees of freedom <= i' P_aa i): without attack i' P_aa i is chi-square for
/// a wide prior, smaller for a narrow one, and 0 without data.
class InputScore {
 public:
  /// Throws UsageError when the prior's covariance is not positive definite.
  explicit InputScore(const Gaussian& prior);

  /// Of a posterior whose last m components are the input; 0 when its covariance there is singular.
  double operator()(const Gaussian& posterior);

 private:
  Eigen::VectorXd prior_information_;  // Pa^-1 a0
  Eigen::VectorXd difference_;
  Eigen::MatrixXd factor_;
};

/// Joint input and state filter without detection: a Kalman filter on z = [x; a] that takes every
/// step for attacked, with p(a) Gaussian; the hybrid Bernoulli filter at r = 1 for one packet.
///
/// KalmanCore has the equations, direct and delayed feedthrough; one vector of Z_k is chosen by
/// PacketChoice. attack_probability is InputScore, that of the gate when it left out every packet;
/// without packets the last one stands. input_step: k, or k - 1 when delayed.
class JointInputState : public Estimator {
 public:
  /// Throws UsageError when model, options and rows do not fit.
  JointInputState(const SystemModel& model, const JointInputStateOptions& options,
                  std::vector<std::vector<int>> rows);

  const Estimate& step(std::int64_t step, const MeasurementSet& measurements,
                       const Eigen::VectorXd& known_input) override;

  /// Packets refused since construction.
  std::int64_t refused_packets() const { return correction_.refused_packets(); }

 private:
  Gaussian attack_prior_;
  KalmanCore core_;
  VectorCorrection correction_;
  Gaussian belief_;  // on z
  InputScore input_score_;
  double score_ = 0.0;
  Estimate estimate_;
};

}  // namespace holdfast
