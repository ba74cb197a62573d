#include "estimators/component_motion.h"
#include "estimators/component_observation.h"
#include "estimators/padded_matrix.h"
#include "tests/support/catch.h"

using namespace holdfast;
using Update = HybridBernoulliOptions::Update;

namespace {

// x+ = x^2 + a, y = x^2.
SystemModel square_model() {
  SystemModel model;
  model.A = model.C = model.G = Eigen::MatrixXd::Ones(1, 1);
  model.H = Eigen::MatrixXd::Zero(1, 1);
  model.Q = Eigen::MatrixXd::Constant(1, 1, 0.25);
  model.R = Eigen::MatrixXd::Constant(1, 1, 0.5);
  model.transition = [](const Eigen::VectorXd& x, const Eigen::VectorXd& a, Eigen::VectorXd& next) {
    next[0] = x[0] * x[0] + a[0];
  };
  model.measurement = [](const Eigen::VectorXd& x, const Eigen::VectorXd&, Eigen::VectorXd& y) {
    y[0] = x[0] * x[0];
  };
  model.transition_jacobian = [](const Eigen::VectorXd& x, const Eigen::VectorXd&,
                                 Eigen::MatrixXd& F) { F << 2.0 * x[0], 1.0; };
  model.measurement_jacobian = [](const Eigen::VectorXd& x, const Eigen::VectorXd&,
                                  Eigen::MatrixXd& J) { J << 2.0 * x[0], 0.0; };
  return model;
}

constexpr double kMean = 3.0, kVariance = 0.4, kSignal = -1.0, kSignalVariance = 0.7;

}  // namespace

TEST_CASE("the unscented motion of a square has its mean, the extended one that of the tangent") {
  const double mean[4] = {kMean, kSignal, 0.0, 0.0};
  const double P[8] = {kVariance, 0.0, 0.0, 0.0, 0.0, kSignalVariance, 0.0, 0.0};
  for (const Update update : {Update::kExtended, Update::kUnscented}) {
    ComponentMotion motion(square_model(), update);
    double next[4], next_P[8];
    motion.move(mean, P, 4, Signal::kKept, next, next_P);
    const bool is_unscented = update == Update::kUnscented;
    CHECK(next[0] == Approx(9.0 + kSignal + (is_unscented ? kVariance : 0.0)).epsilon(1e-14));
    CHECK(next[1] == Approx(kSignal).epsilon(1e-14));
    CHECK(next_P[1] == Approx(kSignalVariance).epsilon(1e-14));  // cov(x+, a)
    CHECK(next_P[4] == next_P[1]);
    CHECK(next_P[5] == Approx(kSignalVariance).epsilon(1e-14));
    // Points at 0 and +-sqrt(3 P), of weights 1/3 and 1/6: fourth moment (3 P)^2 / 3, variance 2
    // P^2.
    const double square_variance = is_unscented ? 2.0 * kVariance * kVariance : 0.0;
    CHECK(next_P[0] == Approx(36.0 * kVariance + square_variance + kSignalVariance + 0.25));
  }
}

TEST_CASE("the unscented observation of a square has the moments of the Gaussian's square") {
  const double mean[4] = {kMean, 0.0, 0.0, 0.0};
  const double P[4] = {kVariance, 0.0, 0.0, 0.0};
  for (const Update update : {Update::kExtended, Update::kUnscented}) {
    ComponentObservation observation(square_model(), {0}, false, update);
    double y[4], S[4], T[4];
    observation.predict(mean, P, 4, 1, y, S, T);
    const bool is_unscented = update == Update::kUnscented;
    CHECK(y[0] == Approx(9.0 + (is_unscented ? kVariance : 0.0)));
    CHECK(T[0] == Approx(6.0 * kVariance));
    // One dimension: points at 0 and +-sqrt(2 P), weights 1/2 and 1/4, variance of the square P^2.
    const double square_variance = is_unscented ? kVariance * kVariance : 0.0;
    CHECK(S[0] == Approx(36.0 * kVariance + square_variance + 0.5));
  }
}

TEST_CASE("padded kernels factorise what is positive, and what has directions without variance") {
  // [4 2 0; 2 1 0; 0 0 9] has rank 2.
  double S[12] = {4.0, 2.0, 0.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 0.0, 9.0, 0.0};
  double copy[12], reciprocals[3];
  std::copy_n(S, 12, copy);
  CHECK_FALSE(padded::factorise(copy, 4, 3, reciprocals, padded::Pivots::kPositive));
  CHECK(padded::factorise(S, 4, 3, reciprocals, padded::Pivots::kNonNegative));
  CHECK(S[0] == 2.0);
  CHECK(S[1] == 1.0);
  CHECK(reciprocals[1] == 0.0);
  CHECK(S[10] == 3.0);
  double negative[4] = {-1.0, 0.0, 0.0, 0.0};
  CHECK_FALSE(padded::factorise(negative, 4, 1, reciprocals, padded::Pivots::kPositive));
  CHECK_FALSE(padded::factorise(negative, 4, 1, reciprocals, padded::Pivots::kNonNegative));
}
