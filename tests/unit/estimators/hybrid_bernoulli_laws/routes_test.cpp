// The two routes that the filter is checked by, against each other and against closed forms.

#include "tests/support/catch.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/closed_forms.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/grid_recursion.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/law_cases.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/sequence_enumeration.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

double worst_disagreement(const LawCase& law, const LawCase& other, const GridAxis& axis = kAxisA) {
  GridRecursion grid(law, kAxisX, axis);
  double worst = 0.0;
  for (std::size_t k = 0; k < law.steps.size(); ++k) {
    const LawPosterior by_grid = grid.step(law.steps[k]);
    const double here = disagreement(by_grid, enumerate_sequences(other, k + 1));
    INFO("step " << k + 1 << ": " << here);
    CHECK(by_grid.r > 0.02);
    CHECK(by_grid.r < 0.98);
    worst = worse(worst, here);
  }
  return worst;
}

}  // namespace

TEST_CASE("integration on a grid and enumeration of all sequences agree") {
  const bool is_direct = GENERATE(true, false);
  const auto correction = GENERATE(kInjection, kSubstitution);
  LawCase law = scalar_case(is_direct, correction);
  CHECK(worst_disagreement(law, law) < 1e-9);
  LawCase other = law;
  other.pb *= 1.01;  // negative control
  CHECK(worst_disagreement(law, other) > 1e-4);
  law = two_attacks_case(is_direct, correction);
  CHECK(worst_disagreement(law, law) < 1e-9);
  law = two_attacks_case(is_direct, correction, 0.7);
  CHECK(worst_disagreement(law, law) < 1e-9);
  law = unknown_delivery_case(is_direct, correction);
  CHECK(worst_disagreement(law, law) < 1e-9);
}

TEST_CASE("both routes agree on packets with some rows only") {
  const bool is_direct = GENERATE(true, false);
  LawCase law = partial_packets_case(is_direct);
  CHECK(worst_disagreement(law, law) < 1e-9);
  law.model.R(0, 1) = law.model.R(1, 0) = 0.1;
  CHECK(worst_disagreement(law, law) < 1e-9);
  law = overlapping_sources_case(is_direct);
  CHECK(worst_disagreement(law, law) < 1e-9);
}

TEST_CASE("both routes agree where y shows one of two channels only") {
  const LawCase law = rank_deficient_case();
  CHECK(worst_disagreement(law, law, kCoarseAxisA) < 1e-7);
}

TEST_CASE("when nothing arrives, enumeration leaves the predicted moments") {
  const bool is_direct = GENERATE(true, false);
  LawCase law = two_attacks_case(is_direct, kInjection);
  law.steps.resize(1);
  law.steps.push_back({});
  CHECK(disagreement(enumerate_sequences(law, 2), predicted(law, enumerate_sequences(law, 1))) <
        1e-12);
}

TEST_CASE("with one packet each and attack for sure, a vague prior of it gives least squares") {
  LawCase law = random_case(2, 3, 2, 4, true, kInjection, {1, 1, 1, 1});
  law.ps = law.start_probability = law.pd = 1.0;
  law.attacks[0].terms[0].covariance = 1e7 * Eigen::Matrix2d::Identity();
  const GaussianState expected = least_squares(law);
  const LawPosterior posterior = enumerate_sequences(law, 4);
  CHECK((posterior.mean1 - expected.mean).cwiseAbs().maxCoeff() < 1e-5);
  CHECK((posterior.covariance1() - expected.covariance).cwiseAbs().maxCoeff() < 1e-5);
}
