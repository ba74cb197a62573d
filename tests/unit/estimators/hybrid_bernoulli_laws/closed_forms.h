#pragma once

#include "tests/unit/estimators/hybrid_bernoulli_laws/law_case.h"

namespace holdfast::testing {

/// Moments one step later when nothing arrives: eqs. (49)-(53) and (62)-(68) of paper 000, of which
/// all but the shape of the densities follows from moments alone.
LawPosterior predicted(const LawCase& law, const LawPosterior& now);

struct GaussianState {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

/// Kalman filter, one step: predicts x+ = F x + w and corrects by y = J x + v, in the information
/// form.
GaussianState kalman_step(const GaussianState& before, const Eigen::MatrixXd& F,
                          const Eigen::VectorXd& push, const Eigen::MatrixXd& process_noise,
                          const Eigen::MatrixXd& J, const Eigen::MatrixXd& noise,
                          const Eigen::VectorXd& y);

/// The last [x; a] by generalised least squares over all of x_1 .. x_K, a_1 .. a_K at once: nothing
/// is known of any a beforehand. Precondition: one packet of all rows at every step, rank H = m.
GaussianState least_squares(const LawCase& law);

}  // namespace holdfast::testing
