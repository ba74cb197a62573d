// The filter against the exact recursion: on a grid (scalar state), and by enumeration of every
// sequence of attacks and associations as one joint Gaussian.

#include "tests/support/catch.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/filter_route.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/grid_recursion.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/law_cases.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/sequence_enumeration.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

// Of the worst step.
double grid_disagreement(const LawCase& law, const LawCase& assumed,
                         const GridAxis& axis = kAxisA) {
  GridRecursion grid(law, kAxisX, axis);
  FilterRoute filter(assumed);
  double worst = 0.0;
  for (const LawStep& step : law.steps) {
    const LawPosterior expected = grid.step(step);
    CHECK(expected.r > 0.02);
    CHECK(expected.r < 0.98);
    worst = worse(worst, disagreement(filter.step(step), expected));
  }
  return worst;
}

}  // namespace

TEST_CASE("scalar system: the filter is the exact recursion, integrated on a grid") {
  const bool is_direct = GENERATE(true, false);
  const auto correction = GENERATE(kInjection, kSubstitution);
  const LawCase law = scalar_case(is_direct, correction);
  CHECK(grid_disagreement(law, law) < 1e-6);
  LawCase other = law;
  other.pb *= 1.01;  // negative control
  CHECK(grid_disagreement(law, other) > 1e-5);
}

TEST_CASE("scalar system, two attack models: the exact recursion on a grid") {
  const bool is_direct = GENERATE(true, false);
  const auto correction = GENERATE(kInjection, kSubstitution);
  const double persistence = GENERATE(0.0, 0.7);
  const LawCase law = two_attacks_case(is_direct, correction, persistence);
  CHECK(grid_disagreement(law, law) < 1e-6);
}

TEST_CASE("scalar system, delivery probability unknown: the exact recursion on a grid") {
  const bool is_direct = GENERATE(true, false);
  const auto correction = GENERATE(kInjection, kSubstitution);
  const LawCase law = unknown_delivery_case(is_direct, correction);
  CHECK(grid_disagreement(law, law) < 1e-6);
}

TEST_CASE("scalar system, packets with some rows only: the exact recursion on a grid") {
  const bool is_direct = GENERATE(true, false);
  const LawCase law = partial_packets_case(is_direct), other = overlapping_sources_case(is_direct);
  CHECK(grid_disagreement(law, law) < 1e-6);
  CHECK(grid_disagreement(other, other) < 1e-6);
}

TEST_CASE("scalar state, two channels of which y shows one: the exact recursion on a grid") {
  const LawCase law = rank_deficient_case();
  CHECK(grid_disagreement(law, law, kCoarseAxisA) < 1e-6);
}

TEST_CASE("every sequence of attacks and associations, one by one, gives the filter's posterior") {
  const bool is_direct = GENERATE(true, false);
  const auto number = GENERATE(range(0U, 4U));
  struct Size {
    int n, m, l;
  };
  const Size size = std::vector<Size>{{2, 1, 3}, {3, 2, 3}, {5, 2, 5}, {4, 1, 2}}[number];
  CHECK(enumeration_disagreement(
            random_case(number, size.n, size.m, size.l, is_direct, kInjection, {2, 1, 2})) < 1e-10);
  CHECK(enumeration_disagreement(
            random_case(number, size.n, size.m, size.l, is_direct, kInjection, {1, 0, 3})) < 1e-10);
  CHECK(enumeration_disagreement(random_case(number, size.n, size.m, size.l, is_direct,
                                             kSubstitution, {1, 0, 1})) < 1e-10);
}

TEST_CASE("correction chosen by what arrives: substitution for one packet, injection for more") {
  const bool is_direct = GENERATE(true, false);
  LawCase law = random_case(1, 2, 1, 3, is_direct, kInjection, {2, 1, 3, 0});
  for (LawStep& step : law.steps) {
    if (step.packets.size() == 1) step.correction = kSubstitution;
  }
  CHECK(enumeration_disagreement(law) < 1e-10);
}

TEST_CASE("what y does not show of the attack is estimated one step later") {
  LawCase law = random_case(2, 3, 2, 4, true, kInjection, {1, 1, 2});
  make_rank_deficient(law);
  CHECK(enumeration_disagreement(law) < 1e-10);
  // In the hidden direction, the prior at first and better one step later.
  FilterRoute filter(law);
  const Eigen::Vector2d hidden = Eigen::Vector2d(-1.0, 2.0).normalized();
  const double prior = hidden.dot(law.attacks[0].terms[0].covariance * hidden);
  filter.step(law.steps[0]);
  const LawPosterior second = filter.step(law.steps[1]);
  REQUIRE(second.mean_before.size() == 2);
  const Eigen::MatrixXd covariance =
      second.square_before - second.mean_before * second.mean_before.transpose();
  CHECK(hidden.dot(covariance * hidden) < 0.9 * prior);
  CHECK(filter.estimate().input_step == 1);
}

TEST_CASE("two attack models, unknown delivery, two nodes, a hidden channel, all at once") {
  const bool is_direct = GENERATE(true, false);
  const LawCase law = everything_case(is_direct);
  FilterRoute filter(law);
  for (std::size_t k = 0; k < law.steps.size(); ++k) {
    const LawPosterior posterior = filter.step(law.steps[k]);
    CHECK(posterior.packet_probability.size() == law.steps[k].packets.size());
    CHECK(disagreement(posterior, enumerate_sequences(law, k + 1)) < 1e-10);
  }
}
