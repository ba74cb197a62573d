// The ends of every probability, sizes about the width of padded rows, packets of a wrong shape,
// and what the published estimate makes of the posterior.

#include "tests/support/catch.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/filter_route.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/law_cases.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/sequence_enumeration.h"

using namespace holdfast;
using namespace holdfast::testing;

TEST_CASE("probabilities of zero and of one") {
  const bool is_direct = GENERATE(true, false);
  const auto correction = GENERATE(kInjection, kSubstitution);
  const LawCase usual = scalar_case(is_direct, correction);
  for (const double end : {0.0, 1.0}) {
    for (const auto probability :
         {&LawCase::start_probability, &LawCase::pb, &LawCase::ps, &LawCase::pf}) {
      LawCase law = usual;
      law.*probability = end;
      CHECK(enumeration_disagreement(law) < 1e-10);
    }
    LawCase law = usual;
    law.pb = law.start_probability = end;
    law.ps = 1.0 - end;
    CHECK(enumeration_disagreement(law) < 1e-10);
  }
  LawCase law = usual;
  law.pd = 1.0;
  CHECK(enumeration_disagreement(law) < 1e-10);
}

TEST_CASE("states, channels and rows of many numbers") {
  const bool is_direct = GENERATE(true, false);
  struct Size {
    int n, m, l;
  };
  const auto number = GENERATE(range(0U, 7U));
  const Size size = std::vector<Size>{{1, 1, 1}, {3, 1, 4},  {4, 1, 5},  {7, 2, 8},
                                      {8, 4, 9}, {10, 2, 1}, {13, 4, 17}}[number];
  CHECK(enumeration_disagreement(random_case(10 + number, size.n, size.m, size.l, is_direct,
                                             kInjection, {2, 1})) < 1e-10);
}

TEST_CASE("a plant without process noise") {
  const bool is_direct = GENERATE(true, false);
  LawCase law = random_case(2, 3, 2, 3, is_direct, kInjection, {1, 2, 1});
  law.model.Q.setZero();
  CHECK(enumeration_disagreement(law) < 1e-10);
}

TEST_CASE("packets far away, and the same packet many times") {
  LawCase law = scalar_case(true, kInjection);
  law.steps[0].packets[1].y *= 1e6;
  law.steps[2].packets.assign(5, law.steps[2].packets[0]);
  CHECK(enumeration_disagreement(law) < 1e-10);
}

TEST_CASE("one source's rows need not be neighbours") {
  LawCase law = random_case(2, 3, 2, 3, true, kInjection, {2, 1, 2});
  law.model.R.row(1) << 0.0, law.model.R(1, 1), 0.0;
  law.model.R.col(1) << 0.0, law.model.R(1, 1), 0.0;
  law.rows = {{0, 2}, {1}};
  for (LawStep& step : law.steps) {
    const LawPacket whole = step.packets[0];
    step.packets[0] = {whole.y({0, 2}), 0};
    step.packets.push_back({whole.y.segment(1, 1), 1});
    if (step.packets.size() == 3) step.packets[1] = {step.packets[1].y({0, 2}), 0};
  }
  for (std::size_t count = 1; count <= 3; ++count) {
    FilterRoute filter(law);
    LawPosterior posterior;
    for (std::size_t k = 0; k < count; ++k) posterior = filter.step(law.steps[k]);
    CHECK(disagreement(posterior, enumerate_sequences(law, count)) < 1e-10);
  }
}

TEST_CASE("two packets in a step of substitution are taken as injection") {
  LawCase law = scalar_case(true, kSubstitution);
  FilterRoute filter(law);
  law.steps[2] = scalar_case(true, kInjection).steps[3];
  for (std::size_t k = 0; k < law.steps.size(); ++k) {
    CHECK(disagreement(filter.step(law.steps[k]), enumerate_sequences(law, k + 1)) < 1e-10);
  }
}

TEST_CASE("packets of no known source or of the wrong size are refused and counted") {
  const LawCase law = scalar_case(true, kInjection);
  FilterRoute filter(law), clean(law);
  std::int64_t refused = 0;
  for (const LawStep& step : law.steps) {
    LawStep dirty = step;
    dirty.packets.push_back({Eigen::Vector2d(1.0, 0.0), 1});
    dirty.packets.push_back({Eigen::Vector2d(1.0, 0.0), -1});
    dirty.packets.push_back({Eigen::Vector3d(1.0, 0.0, 0.0), 0});
    dirty.packets.push_back({Eigen::VectorXd(0), 0});
    LawPosterior one = filter.step(dirty);
    refused += 4;
    CHECK(filter.estimate().outcome == StepOutcome::kRefusedInput);
    CHECK(filter.filter().refused_packets() == refused);
    REQUIRE(one.packet_probability.size() == dirty.packets.size());
    for (std::size_t p = step.packets.size(); p < dirty.packets.size(); ++p) {
      CHECK(one.packet_probability[p] == 0.0);
    }
    one.packet_probability.resize(step.packets.size());
    CHECK(disagreement(one, clean.step(step)) < 1e-14);
  }
}

TEST_CASE("the estimate says what the posterior is") {
  const bool is_direct = GENERATE(true, false);
  const LawCase law = two_attacks_case(is_direct, kInjection, 0.6);
  FilterRoute filter(law, [](HybridBernoulliOptions& options) {
    options.state = HybridBernoulliOptions::State::kMean;
  });
  for (std::size_t k = 0; k < law.steps.size(); ++k) {
    filter.step(law.steps[k]);
    const Estimate& said = filter.estimate();
    const LawPosterior expected = enumerate_sequences(law, k + 1);
    const Eigen::VectorXd mean1 = expected.mean1.head(1);
    const Eigen::VectorXd mean = (1.0 - expected.r) * expected.mean0 + expected.r * mean1;
    const Eigen::MatrixXd square =
        (1.0 - expected.r) * expected.square0 + expected.r * expected.square1.topLeftCorner(1, 1);
    CHECK(said.step == static_cast<std::int64_t>(k) + 1);
    CHECK(said.attack_probability == Approx(expected.r).epsilon(1e-10));
    CHECK(difference(said.mean, mean) < 1e-10);
    CHECK(difference(said.covariance, square - mean * mean.transpose()) < 1e-10);
    REQUIRE(said.hypotheses.size() == 2);
    CHECK(said.hypotheses[1].name == "attack");
    CHECK(said.hypotheses[0].probability == Approx(1.0 - expected.r).epsilon(1e-10));
    CHECK(said.hypotheses[1].probability == Approx(expected.r).epsilon(1e-10));
    CHECK(difference(said.hypotheses[0].mean, expected.mean0) < 1e-10);
    CHECK(difference(said.hypotheses[1].mean, mean1) < 1e-10);
    CHECK(difference(said.hypotheses[0].covariance, expected.covariance0()) < 1e-10);
    CHECK(difference(said.hypotheses[1].covariance, expected.covariance1().topLeftCorner(1, 1)) <
          1e-10);
    REQUIRE(said.mode_probability.size() == 2);
    CHECK(said.mode_probability[0] == Approx(expected.attack_probability[0]).epsilon(1e-10));
    CHECK(said.input_step == said.step - (is_direct ? 0 : 1));
    CHECK(said.packet_rx_index.size() == law.steps[k].packets.size());
  }
}
