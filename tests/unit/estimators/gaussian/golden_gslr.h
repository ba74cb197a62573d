#pragma once

#include <string>

#include "common/models/turning_target/turning_target_model.h"
#include "estimators/attack_hypotheses.h"
#include "estimators/rts_smoother.h"
#include "estimators/sized_model.h"
#include "tests/support/golden.h"

namespace holdfast::testing {

/// Largest difference, relative to the largest element of what is wanted.
inline double relative_difference(const Eigen::MatrixXd& value, const Eigen::MatrixXd& wanted) {
  REQUIRE(value.rows() == wanted.rows());
  REQUIRE(value.cols() == wanted.cols());
  const double scale = wanted.cwiseAbs().maxCoeff();
  return (value - wanted).cwiseAbs().maxCoeff() / (scale > 0.0 ? scale : 1.0);
}

inline AttackStatistics statistics_of(const nlohmann::json& theta) {
  AttackStatistics statistics;
  statistics.attack_probability = 1.0 - theta.at("alpha_b").get<double>();
  statistics.dos_probability = 1.0 - theta.at("alpha_c").get<double>();
  statistics.bias_probability = theta.at("alpha_a");
  statistics.scale_probability = theta.at("alpha_m");
  statistics.bias_mean = vector_of(theta.at("mu_a"));
  statistics.bias_covariance = matrix_of(theta.at("Sigma_a"));
  statistics.scale_mean = theta.at("mu_m");
  statistics.scale_std = std::sqrt(theta.at("sigma2_m").get<double>());
  return statistics;
}

inline SystemModel system_of(const nlohmann::json& theta) {
  SystemModel model;
  model.A = matrix_of(theta.at("A"));
  model.C = matrix_of(theta.at("H"));
  model.Q = matrix_of(theta.at("Q"));
  model.R = matrix_of(theta.at("R"));
  model.G = Eigen::MatrixXd::Zero(model.A.rows(), 0);
  model.H = Eigen::MatrixXd::Zero(model.C.rows(), 0);
  return model;
}

/// How a run of the golden files is filtered.
enum class Kernel { kStandard, kExact, kPaper, kMixture };

/// One measurement update by the kernel; the belief stays where nothing can be learnt.
template <int N, int L>
void update_by(Kernel kernel, const AttackStatistics& statistics, const Small<L, L>& R,
               const Observation<N, L>& observation, const Small<L>& y, Belief<N>& belief) {
  const Belief<N> prior = belief;
  if (kernel == Kernel::kMixture) {
    AttackHypotheses<N, L> hypotheses(statistics, 0.0);
    hypotheses.update(prior, observation, R, y, belief);
    return;
  }
  ReadingBelief<L> reading;
  if (kernel == Kernel::kStandard) {
    believe_reading(observation, R, reading);
  } else {
    regress_reading(
        observation, R, SizedAttackStatistics<L>(statistics),
        kernel == Kernel::kPaper ? RegressionMoments::kPaper : RegressionMoments::kExact, reading);
  }
  GaussianUpdate<N, L> update;
  REQUIRE(update.weigh(observation, reading, y).is_definite);
  update.apply(prior, observation, reading, belief);
}

}  // namespace holdfast::testing
