// What the filter must be in the limits that textbooks know.

#include "tests/support/catch.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/closed_forms.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/filter_route.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/law_cases.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/sequence_enumeration.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

const std::vector<int> kOneEach(12, 1);

}  // namespace

TEST_CASE("no attack ever, every packet delivered, one each: the Kalman filter") {
  const bool is_direct = GENERATE(true, false);
  LawCase law = random_case(2, 3, 2, 3, is_direct, kInjection, kOneEach);
  law.pb = law.start_probability = 0.0;
  law.pd = 1.0;
  FilterRoute filter(law);
  const auto& [A, C, Q, R] = std::tie(law.model.A, law.model.C, law.model.Q, law.model.R);
  const Eigen::MatrixXd still = Eigen::MatrixXd::Identity(3, 3), none = Eigen::MatrixXd::Zero(3, 3);
  const Eigen::VectorXd no_push = Eigen::VectorXd::Zero(3);
  GaussianState state{law.start_mean, law.start_covariance};
  for (std::size_t k = 0; k < law.steps.size(); ++k) {
    state = kalman_step(state, k == 0 ? still : A, no_push, k == 0 ? none : Q, C, R,
                        law.steps[k].packets[0].y);
    const LawPosterior posterior = filter.step(law.steps[k]);
    CHECK(posterior.r == 0.0);
    CHECK(difference(posterior.mean0, state.mean) < 1e-10);
    CHECK(difference(posterior.covariance0(), state.covariance) < 1e-10);
  }
}

TEST_CASE("no attack ever, several packets: data association over all sequences") {
  LawCase law = random_case(2, 3, 2, 3, true, kInjection, {2, 0, 3});
  law.pb = law.start_probability = 0.0;
  FilterRoute filter(law);
  for (std::size_t k = 0; k < law.steps.size(); ++k) {
    const LawPosterior posterior = filter.step(law.steps[k]);
    CHECK(posterior.r == 0.0);
    CHECK(disagreement(posterior, enumerate_sequences(law, k + 1)) < 1e-10);
  }
}

TEST_CASE("attacked for sure, every packet delivered, one each: joint input and state filter") {
  const bool is_direct = GENERATE(true, false);
  LawCase law = random_case(2, 3, 2, 4, is_direct, kInjection, kOneEach);
  law.ps = law.start_probability = 1.0;
  law.pd = 1.0;
  FilterRoute filter(law);
  const int n = law.n(), m = law.m();
  const SignalTerm& a = law.attacks[0].terms[0];
  // z = [x; a], a white: F z keeps nothing of a but what moved x.
  Eigen::MatrixXd F = Eigen::MatrixXd::Zero(n + m, n + m), J(4, n + m), gain(n + m, m);
  F.topLeftCorner(n, n) = law.model.A;
  if (is_direct) F.topRightCorner(n, m) = law.model.G;
  J << law.model.C, law.model.H;
  gain << (is_direct ? 0.0 : 1.0) * law.model.G, Eigen::MatrixXd::Identity(m, m);
  Eigen::MatrixXd noise = gain * a.covariance * gain.transpose();
  noise.topLeftCorner(n, n) += law.model.Q;
  // Step 1 is not predicted: from nothing to [x_1; a].
  Eigen::MatrixXd first_noise = Eigen::MatrixXd::Zero(n + m, n + m), still = first_noise;
  first_noise.topLeftCorner(n, n) = law.start_covariance;
  first_noise.bottomRightCorner(m, m) = a.covariance;
  Eigen::VectorXd first_push(n + m);
  first_push << law.start_mean, a.mean;
  GaussianState state{Eigen::VectorXd::Zero(n + m), still};
  for (std::size_t k = 0; k < law.steps.size(); ++k) {
    const Eigen::VectorXd push = k == 0 ? first_push : Eigen::VectorXd(gain * a.mean);
    state = kalman_step(state, k == 0 ? still : F, push, k == 0 ? first_noise : noise, J,
                        law.model.R, law.steps[k].packets[0].y);
    const LawPosterior posterior = filter.step(law.steps[k]);
    CHECK(posterior.r == 1.0);
    CHECK(difference(posterior.mean1, state.mean) < 1e-10);
    CHECK(difference(posterior.covariance1(), state.covariance) < 1e-10);
  }
}

TEST_CASE("attacked for sure by who knows what: generalised least squares") {
  LawCase law = random_case(2, 3, 2, 4, true, kInjection, kOneEach);
  law.ps = law.start_probability = law.pd = 1.0;
  law.attacks[0].terms[0].mean.setZero();
  FilterRoute filter(law, [](HybridBernoulliOptions& options) {
    options.input_prior = HybridBernoulliOptions::InputPrior::kFlat;
  });
  LawCase part = law;
  part.steps.clear();
  for (const LawStep& step : law.steps) {
    part.steps.push_back(step);
    const GaussianState expected = least_squares(part);
    const LawPosterior posterior = filter.step(step);
    CHECK(posterior.r == 1.0);
    CHECK(difference(posterior.mean1, expected.mean) < 1e-9);
    CHECK(difference(posterior.covariance1(), expected.covariance) < 1e-9);
  }
}

TEST_CASE("nothing arrives: the predicted triplet stays, whatever pd") {
  const bool is_direct = GENERATE(true, false);
  const auto correction = GENERATE(kInjection, kSubstitution);
  const double pd = GENERATE(0.9, 1.0);
  LawCase law = two_attacks_case(is_direct, correction);
  law.pd = pd;
  FilterRoute filter(law);
  LawPosterior posterior = filter.step(law.steps[0]);
  for (int k = 0; k < 3; ++k) {
    const LawPosterior expected = predicted(law, posterior);
    posterior = filter.step({correction, {}});
    CHECK(filter.estimate().outcome == StepOutcome::kNoPackets);
    CHECK(disagreement(posterior, expected) < 1e-12);
  }
  // And at the first step there is nothing to predict.
  FilterRoute fresh(law);
  CHECK(fresh.step({correction, {}}).r == Approx(law.start_probability).epsilon(1e-14));
}
