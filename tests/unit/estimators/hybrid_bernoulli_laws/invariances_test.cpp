// What may not change the filter's mind, and what may not hurt it.

#include <algorithm>
#include <limits>

#include "tests/support/catch.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/filter_route.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/law_cases.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/law_simulation.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/sequence_enumeration.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

// Reduction as scenarios use it.
void reduce_much(HybridBernoulliOptions& options) {
  options.prune_below = 1e-4;
  options.merge_below = 0.5;
  options.components_max = 30;
}

// The same plant in other units: each diagonal holds the size of an old unit in new ones.
LawCase in_units(const LawCase& law, const Eigen::VectorXd& x, const Eigen::VectorXd& y,
                 const Eigen::VectorXd& a) {
  LawCase other = law;
  const auto X = x.asDiagonal(), Y = y.asDiagonal();
  const Eigen::MatrixXd X_back = x.cwiseInverse().asDiagonal(),
                        A_back = a.cwiseInverse().asDiagonal();
  other.model.A = X * law.model.A * X_back;
  other.model.G = X * law.model.G * A_back;
  other.model.C = Y * law.model.C * X_back;
  other.model.H = Y * law.model.H * A_back;
  other.model.Q = X * law.model.Q * X;
  other.model.R = Y * law.model.R * Y;
  other.start_mean = X * law.start_mean;
  other.start_covariance = X * law.start_covariance * X;
  other.box_low = Y * law.box_low;
  other.box_high = Y * law.box_high;
  for (AttackLaw& attack : other.attacks) {
    const Eigen::VectorXd scale = a(attack.channels);
    for (SignalTerm& term : attack.terms) {
      term.mean = scale.cwiseProduct(term.mean).eval();
      term.covariance = (scale.asDiagonal() * term.covariance * scale.asDiagonal()).eval();
    }
  }
  for (LawStep& step : other.steps) {
    for (LawPacket& packet : step.packets) packet.y = Y * packet.y;
  }
  return other;
}

LawStep reversed(const LawStep& step) {
  LawStep other = step;
  std::reverse(other.packets.begin(), other.packets.end());
  return other;
}

}  // namespace

TEST_CASE("the order of packets does not matter") {
  const bool is_direct = GENERATE(true, false);
  const LawCase law = random_case(3, 3, 2, 3, is_direct, kInjection, {4, 4, 3});
  FilterRoute filter(law), other(law);
  for (const LawStep& step : law.steps) {
    const LawPosterior one = filter.step(step);
    LawPosterior two = other.step(reversed(step));
    std::reverse(two.packet_probability.begin(), two.packet_probability.end());
    CHECK(one.packet_probability.size() == step.packets.size());
    CHECK(disagreement(one, two) < 1e-11);
  }
}

TEST_CASE("units of x, y and a do not matter") {
  const bool is_direct = GENERATE(true, false);
  const auto correction = GENERATE(kInjection, kSubstitution);
  LawCase law = random_case(5, 3, 2, 3, is_direct, correction, {});
  law.steps = simulate(law, 0, 30, correction, 4).steps;
  const Eigen::Vector3d x(1e3, 0.02, 5.0), y(1e-3, 40.0, 7.0);
  const Eigen::Vector2d a(1e2, 0.3);
  const LawCase scaled = in_units(law, x, y, a);
  FilterRoute filter(law, reduce_much),
      other(scaled, reduce_much);  // the correction is that of the steps
  Eigen::VectorXd z(5);
  z << x, a;
  for (std::size_t k = 0; k < law.steps.size(); ++k) {
    const LawPosterior one = filter.step(law.steps[k]);
    LawPosterior two = other.step(scaled.steps[k]);
    two.mean0 = two.mean0.cwiseQuotient(x).eval();
    two.mean1 = two.mean1.cwiseQuotient(z).eval();
    two.square0 =
        (x.cwiseInverse().asDiagonal() * two.square0 * x.cwiseInverse().asDiagonal()).eval();
    two.square1 =
        (z.cwiseInverse().asDiagonal() * two.square1 * z.cwiseInverse().asDiagonal()).eval();
    CHECK(disagreement(one, two) < 1e-8);
  }
}

TEST_CASE("packets out of the box: constant, floor and zero mean what they say") {
  const auto outside = GENERATE(OutsideLaw::kConstant, OutsideLaw::kFloor, OutsideLaw::kZero);
  const auto correction = GENERATE(kInjection, kSubstitution);
  LawCase law = scalar_case(true, correction);
  law.outside = outside;
  law.floor = 1e-2;
  law.box_high =
      Eigen::Vector2d(1.5, 8.0);  // a packet of the third step, and of the fourth, is out
  FilterRoute filter(law);
  for (std::size_t k = 0; k < law.steps.size(); ++k) {
    const LawPosterior expected = enumerate_sequences(law, k + 1);
    CHECK(disagreement(filter.step(law.steps[k]), expected) < 1e-10);
  }
}

TEST_CASE("five hundred packets in a step") {
  LawCase law = random_case(4, 3, 2, 3, true, kInjection, {2, 500, 500, 1});
  FilterRoute filter(law, reduce_much), other(law, reduce_much);
  for (const LawStep& step : law.steps) {
    const LawPosterior one = filter.step(step);
    const LawPosterior two = other.step(reversed(step));
    CHECK(one.mean0.allFinite());
    CHECK(one.square1.allFinite());
    CHECK(one.r == Approx(two.r).epsilon(1e-9));
    // Children of at most 2 x 30 parents, of either hypothesis: the work of a step is bounded.
    CHECK(filter.filter().num_components() <= 60);
    CHECK(filter.filter().num_candidates() <=
          2 * 60 * (static_cast<std::int64_t>(step.packets.size()) + 1));
  }
}

TEST_CASE("packets with NaN or infinity are left out, and the outcome says so") {
  const double bad =
      GENERATE(std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
               -std::numeric_limits<double>::infinity());
  const auto correction = GENERATE(kInjection, kSubstitution);
  const LawCase law = scalar_case(true, correction);
  FilterRoute filter(law), clean(law);
  std::int64_t refused = 0;
  for (const LawStep& step : law.steps) {
    LawStep dirty = step;
    dirty.packets.insert(dirty.packets.begin(), {Eigen::Vector2d(0.3, bad), 0});
    LawPosterior one = filter.step(dirty);
    CHECK(filter.filter().refused_packets() == ++refused);
    CHECK(filter.estimate().outcome == StepOutcome::kRefusedInput);
    const LawPosterior two = clean.step(step);
    one.packet_probability.clear();
    CHECK(disagreement(one, two) < 1e-14);
  }
}

TEST_CASE("the unscented and the extended update of a linear model are the linear one") {
  const bool is_direct = GENERATE(true, false);
  const auto correction = GENERATE(kInjection, kSubstitution);
  LawCase law = two_attacks_case(is_direct, correction);
  LawCase as_function = law;
  const SystemModel& model = law.model;
  as_function.model.transition = [model](const auto& x, const auto& a, auto& next) {
    next = model.A * x + model.G * a;
  };
  as_function.model.measurement = [model](const auto& x, const auto& a, auto& y) {
    y = model.C * x + model.H * a;
  };
  as_function.model.transition_jacobian = [model](const auto&, const auto&, auto& F) {
    F << model.A, model.G;
  };
  as_function.model.measurement_jacobian = [model](const auto&, const auto&, auto& J) {
    J << model.C, model.H;
  };
  FilterRoute linear(law), extended(as_function);
  FilterRoute unscented(as_function, [](HybridBernoulliOptions& options) {
    options.update = HybridBernoulliOptions::Update::kUnscented;
  });
  for (const LawStep& step : law.steps) {
    const LawPosterior expected = linear.step(step);
    CHECK(disagreement(extended.step(step), expected) < 1e-12);
    CHECK(disagreement(unscented.step(step), expected) < 1e-10);
  }
}
