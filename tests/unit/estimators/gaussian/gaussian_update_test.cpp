// What rounding leaves of a posterior covariance where a good sensor meets a vague prior.

#include "estimators/gaussian_update.h"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/models/system_model.h"
#include "common/random_stream.h"
#include "estimators/sized_model.h"
#include "tests/support/catch.h"

namespace holdfast {
namespace {

using LongMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;

struct VaguePrior {
  Eigen::MatrixXd P, H, R;

  VaguePrior(int n, int l, std::uint32_t number) : P(n, n), H(l, n), R(l, l) {
    const RandomStream stream(1, number, "test/vague_prior");
    std::uint64_t draw = 0;
    for (double& value : P.reshaped()) value = stream.normal(1, draw++);
    for (double& value : H.reshaped()) value = stream.normal(2, draw++);
    P = (P * P.transpose() + Eigen::MatrixXd::Identity(n, n)).eval() * 1e8;
    R.setIdentity();
  }

  // (I - K H) P (I - K H)' + K R K' as it is written, with as many digits as Scalar has.
  template <class Scalar>
  Eigen::MatrixXd textbook() const {
    using Matrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
    const Matrix P_ = P.cast<Scalar>(), H_ = H.cast<Scalar>(), R_ = R.cast<Scalar>();
    const Matrix S = H_ * P_ * H_.transpose() + R_;
    const Matrix K = P_ * H_.transpose() * S.inverse();
    const Matrix keep = Matrix::Identity(P.rows(), P.rows()) - K * H_;
    return (keep * P_ * keep.transpose() + K * R_ * K.transpose()).template cast<double>();
  }

  // How wrong the variance of what was seen is, as a share of it.
  double error_of(const Eigen::MatrixXd& posterior) const {
    const Eigen::MatrixXd exact = H * textbook<long double>() * H.transpose();
    return (H * posterior * H.transpose() - exact).cwiseAbs().maxCoeff() /
           exact.cwiseAbs().maxCoeff();
  }
};

template <int N, int L>
Eigen::MatrixXd posterior_of(const VaguePrior& prior, bool has_jacobian) {
  const Belief<N> belief{Small<N>::Zero(prior.P.rows()), prior.P};
  Observation<N, L> observation;
  observe_linear<N, L>(prior.H, belief, observation);
  observation.has_jacobian = has_jacobian;
  ReadingBelief<L> reading;
  believe_reading<N, L>(observation, prior.R, reading);
  GaussianUpdate<N, L> update;
  Belief<N> posterior = belief;
  REQUIRE(update.weigh(observation, reading, Small<L>::Zero(prior.R.rows())).is_definite);
  update.apply(belief, observation, reading, posterior);
  CHECK(posterior.covariance == posterior.covariance.transpose());
  return posterior.covariance;
}

// Of an odd number.
double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

template <int N, int L>
struct UpdateSize {
  static constexpr int kStates = N, kReadings = L;
};

}  // namespace

TEMPLATE_TEST_CASE(
    "rounding of a vague prior does not reach the covariance, as it does in the short form", "",
    (UpdateSize<2, 2>), (UpdateSize<4, 2>), (UpdateSize<4, 4>), (UpdateSize<12, 12>),
    (UpdateSize<Eigen::Dynamic, Eigen::Dynamic>)) {
  constexpr int N = TestType::kStates, L = TestType::kReadings;
  std::vector<double> ours, textbook, short_form;
  for (std::uint32_t number = 0; number < 51; ++number) {
    const VaguePrior prior(N == Eigen::Dynamic ? 5 : N, L == Eigen::Dynamic ? 3 : L, number);
    ours.push_back(prior.error_of(posterior_of<N, L>(prior, true)));
    short_form.push_back(prior.error_of(posterior_of<N, L>(prior, false)));
    textbook.push_back(prior.error_of(prior.textbook<double>()));
  }
  CHECK(median(ours) < 20.0 * median(textbook));
  // Where everything is seen, nothing of the prior is left that could hide what was lost.
  if (L != Eigen::Dynamic && N == L) {
    CHECK(median(ours) < 1e-12);
    CHECK(median(short_form) > 1e4 * median(ours));
  }
}

TEST_CASE("sigma points do not bring the rounding of a vague prior back") {
  std::vector<double> ours, short_form;
  for (std::uint32_t number = 0; number < 51; ++number) {
    const VaguePrior prior(4, 4, number);
    SystemModel model;
    model.A = model.Q = Eigen::MatrixXd::Identity(4, 4);
    model.C = prior.H;
    model.G = model.H = Eigen::MatrixXd::Zero(4, 0);
    model.R = prior.R;
    model.measurement = [&prior](const Eigen::VectorXd& x, const Eigen::VectorXd& /*a*/,
                                 Eigen::VectorXd& y) { y.noalias() = prior.H * x; };
    SizedModel<4, 4> sized(model, Linearisation::kUnscented);
    const Belief<4> belief{Small<4>::Zero(), prior.P};
    Observation<4, 4> observation;
    sized.observe(belief, observation);
    // Linear, so nothing is left; and never a negative variance.
    CHECK(observation.unexplained.diagonal().minCoeff() >= 0.0);
    CHECK(observation.unexplained.maxCoeff() < 1e-12);
    ReadingBelief<4> reading;
    believe_reading<4, 4>(observation, prior.R, reading);
    GaussianUpdate<4, 4> update;
    Belief<4> posterior;
    REQUIRE(update.weigh(observation, reading, Small<4>::Zero()).is_definite);
    for (const bool has_jacobian : {true, false}) {
      observation.has_jacobian = has_jacobian;
      update.apply(belief, observation, reading, posterior);
      (has_jacobian ? ours : short_form).push_back(prior.error_of(posterior.covariance));
    }
  }
  CAPTURE(1e15 * median(ours), 1e15 * median(short_form));
  CHECK(median(ours) < 1e-12);
  CHECK(median(short_form) > 1e4 * median(ours));
}

TEMPLATE_TEST_CASE("what a regression leaves unexplained counts as noise of the reading", "",
                   (UpdateSize<4, 2>), (UpdateSize<12, 12>),
                   (UpdateSize<Eigen::Dynamic, Eigen::Dynamic>)) {
  constexpr int N = TestType::kStates, L = TestType::kReadings;
  for (std::uint32_t number = 0; number < 20; ++number) {
    VaguePrior prior(N == Eigen::Dynamic ? 5 : N, L == Eigen::Dynamic ? 3 : L, number);
    prior.P *= 1e-8;  // not vague, so that both forms are exact but for a few roundings
    const auto l = prior.R.rows();
    const Belief<N> belief{Small<N>::Zero(prior.P.rows()), prior.P};
    Observation<N, L> observation;
    observe_linear<N, L>(prior.H, belief, observation);
    observation.has_unexplained = true;
    observation.unexplained = prior.H.leftCols(2) * prior.H.leftCols(2).transpose();
    observation.Phh += observation.unexplained;
    if (number % 2 == 1) observation.leave_out(number % l);
    ReadingBelief<L> reading;
    reading.c = 0.7;
    reading.mean = reading.c * observation.h;
    reading.Omega = prior.R;
    reading.S = 0.49 * observation.Phh + prior.R;

    GaussianUpdate<N, L> update;
    Belief<N> joseph, plain;
    const Small<L> y = Small<L>::Ones(l);
    REQUIRE(update.weigh(observation, reading, y).is_definite);
    update.apply(belief, observation, reading, joseph);
    observation.has_jacobian = false;
    update.apply(belief, observation, reading, plain);
    const double size = prior.P.cwiseAbs().maxCoeff();
    CHECK((joseph.covariance - plain.covariance).cwiseAbs().maxCoeff() < 1e-11 * size);
    CHECK((joseph.mean - plain.mean).cwiseAbs().maxCoeff() < 1e-11 * size);
  }
}

}  // namespace holdfast
