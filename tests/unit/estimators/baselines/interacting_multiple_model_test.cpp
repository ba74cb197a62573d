#include "estimators/interacting_multiple_model.h"

#include <cmath>

#include "common/errors.h"
#include "estimators/joint_input_state.h"
#include "estimators/kalman_filter.h"
#include "estimators/probabilistic_data_association.h"
#include "tests/unit/estimators/baselines/baseline_cases.h"

using namespace holdfast;
using namespace holdfast::testing;
using Packets = InteractingMultipleModelOptions::Packets;

namespace {

InteractingMultipleModelOptions two_mode_options(Packets packets) {
  InteractingMultipleModelOptions options;
  options.start = kStartOptions;
  options.attack_prior = kPriorOptions;
  options.start_attack_probability = 0.3;
  options.birth_probability = 0.2;
  options.survival_probability = 0.7;
  options.packets = packets;
  options.delivery_probability = 0.9;
  options.packet_box = {std::vector<double>(4, -10.0), std::vector<double>(4, 10.0)};
  return options;
}

Gaussian moments(const std::vector<double>& weights, const std::vector<Gaussian>& components) {
  Gaussian result{Eigen::VectorXd::Zero(3), Eigen::MatrixXd::Zero(3, 3)};
  for (std::size_t i = 0; i < weights.size(); ++i) result.mean += weights[i] * components[i].mean;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const Eigen::VectorXd off = components[i].mean - result.mean;
    result.covariance += weights[i] * (components[i].covariance + off * off.transpose());
  }
  return result;
}

}  // namespace

TEST_CASE("a mode that cannot end is the filter of that mode") {
  for (const Packets packets : {Packets::kChoice, Packets::kAll}) {
    for (const bool is_direct : {true, false}) {
      const SystemModel model = small_model(is_direct);
      const Path path(model, kStart, kPrior, std::vector<bool>(6, true), 0);
      auto options = two_mode_options(packets);
      options.delivery_probability = packets == Packets::kChoice ? 0.9 : 1.0;
      options.start_attack_probability = options.birth_probability = 0.0;
      InteractingMultipleModel never(model, options, kOneSource);
      options.start_attack_probability = options.survival_probability = 1.0;
      InteractingMultipleModel always(model, options, kOneSource);
      KalmanFilterOptions kalman_options;
      kalman_options.start = options.start;
      KalmanFilter kalman(model, kalman_options, kOneSource);
      JointInputStateOptions joint_options;
      joint_options.start = options.start;
      joint_options.attack_prior = options.attack_prior;
      JointInputState joint(model, joint_options, kOneSource);
      for (int k = 1; k <= 6; ++k) {
        const MeasurementSet set = k == 4 ? empty_set(k) : set_at(path, k);
        const Estimate& kalman_says = kalman.step(k, set, kNoInput);
        const Estimate& never_says = never.step(k, set, kNoInput);
        CHECK(difference(never_says, {kalman_says.mean, kalman_says.covariance}) < 1e-12);
        CHECK(never_says.attack_probability == 0.0);
        const Estimate& joint_says = joint.step(k, set, kNoInput);
        const Estimate& always_says = always.step(k, set, kNoInput);
        CHECK(difference(always_says, {joint_says.mean, joint_says.covariance}) < 1e-12);
        CHECK(difference(always_says.input_mean, joint_says.input_mean) < 1e-12);
        CHECK(difference(always_says.input_covariance, joint_says.input_covariance) < 1e-12);
        CHECK(always_says.input_step == joint_says.input_step);
        CHECK(always_says.attack_probability == 1.0);
      }
    }
  }
}

TEST_CASE("without attack modes the packets' mixture is probabilistic data association") {
  const SystemModel model = small_model(true);
  const Path path(model, kStart, kPrior, std::vector<bool>(5, false), 4);
  auto options = two_mode_options(Packets::kAll);
  options.start_attack_probability = options.birth_probability = 0.0;
  InteractingMultipleModel filter(model, options, kOneSource);
  ProbabilisticDataAssociationOptions pda_options;
  pda_options.start = options.start;
  pda_options.delivery_probability = options.delivery_probability;
  pda_options.packet_box = options.packet_box;
  ProbabilisticDataAssociation association(model, pda_options, kOneSource);
  for (int k = 1; k <= 5; ++k) {
    MeasurementSet set = set_at(path, k);
    add_packet(set, 0, {0.5, -0.3, 0.2, 0.4}, 77);
    const Estimate& wanted = association.step(k, set, kNoInput);
    const Estimate& estimate = filter.step(k, set, kNoInput);
    CHECK(difference(estimate, {wanted.mean, wanted.covariance}) < 1e-12);
    for (std::size_t p = 0; p < 2; ++p) {
      CHECK(estimate.packet_probability[p] == Approx(wanted.packet_probability[p]).margin(1e-12));
    }
  }
}

TEST_CASE(
    "modes of one vector have Bayes's probabilities, and the mixture goes on with its moments") {
  for (const bool is_direct : {true, false}) {
    const SystemModel model = small_model(is_direct);
    const Path path(model, kStart, kPrior, {true, true}, 2);
    InteractingMultipleModel filter(model, two_mode_options(Packets::kChoice), kOneSource);
    // Delayed: what happened before step 1 leaves no trace, so both modes are alike there.
    const std::vector<bool> attack_at_1 = {is_direct, false};
    const std::vector<std::vector<bool>> modes = {{false, false}, {is_direct, false}};
    std::vector<double> weights;
    std::vector<Gaussian> posteriors;
    for (std::size_t mode = 0; mode < 2; ++mode) {
      Batch batch(model, kStart, kPrior, modes[mode]);
      batch.observe(1, kOneSource[0], path.y[0]);
      weights.push_back((mode == 0 ? 0.7 : 0.3) * std::exp(batch.log_likelihood()));
      posteriors.push_back(batch.posterior(1));
    }
    const double sum = weights[0] + weights[1];
    const Estimate& first = filter.step(1, set_at(path, 1), kNoInput);
    CHECK(first.attack_probability == Approx(weights[1] / sum).epsilon(1e-12));
    CHECK(first.mode_probability.at(0) == Approx(weights[0] / sum).epsilon(1e-12));
    CHECK(difference(first.hypotheses.at(0).mean, posteriors[0].mean) < 1e-12);
    CHECK(difference(first.hypotheses.at(1).covariance, posteriors[1].covariance) < 1e-12);
    CHECK(difference(first, moments({weights[0] / sum, weights[1] / sum}, posteriors)) < 1e-12);

    // No packet at step 2: the moments of all four sequences, which matching keeps.
    std::vector<double> sequence_weights;
    std::vector<Gaussian> sequences;
    for (std::size_t from = 0; from < 2; ++from) {
      for (std::size_t to = 0; to < 2; ++to) {
        // Direct: a_1 acts on x_2 in mode `from`. Delayed: the mode at step 2 is that of a_1.
        const bool acts = is_direct ? from == 1 : to == 1;
        Batch batch(model, kStart, kPrior, {acts, false});
        batch.observe(1, kOneSource[0], path.y[0]);
        const double to_attack = from == 0 ? 0.2 : 0.7;
        sequence_weights.push_back(weights[from] / sum * (to == 1 ? to_attack : 1.0 - to_attack));
        sequences.push_back(batch.posterior(2));
      }
    }
    const Estimate& second = filter.step(2, empty_set(2), kNoInput);
    CHECK(second.attack_probability ==
          Approx(sequence_weights[1] + sequence_weights[3]).epsilon(1e-12));
    CHECK(difference(second, moments(sequence_weights, sequences)) < 1e-12);
  }
}

TEST_CASE("all packets weigh the modes by the injection likelihood") {
  const SystemModel model = small_model(true);
  const Path path(model, kStart, kPrior, {true}, 2);
  MeasurementSet set = set_at(path, 1);
  const Eigen::Vector4d other(2.0, 1.0, -0.5, 1.0);
  add_packet(set, 0, part_of(other, kOneSource[0]), 78);
  std::vector<double> likelihoods, own;
  for (const bool is_attacked : {false, true}) {
    double densities = 0.0;
    for (const Eigen::VectorXd& y : {path.y[0], Eigen::VectorXd(other)}) {
      Batch batch(model, kStart, kPrior, {is_attacked});
      batch.observe(1, kOneSource[0], y);
      densities += std::exp(batch.log_likelihood());
      if (y == path.y[0]) own.push_back(0.45 * 160000.0 * std::exp(batch.log_likelihood()));
    }
    likelihoods.push_back(0.1 + 0.45 * 160000.0 * densities);  // volume 20^4
  }
  const double total = 0.7 * likelihoods[0] + 0.3 * likelihoods[1];
  InteractingMultipleModel filter(model, two_mode_options(Packets::kAll), kOneSource);
  const Estimate& estimate = filter.step(1, set, kNoInput);
  CHECK(estimate.attack_probability == Approx(0.3 * likelihoods[1] / total).epsilon(1e-11));
  CHECK(estimate.packet_probability.at(0) ==
        Approx((0.7 * own[0] + 0.3 * own[1]) / total).epsilon(1e-11));
}

TEST_CASE("the mode probability tells an attack from none") {
  for (const Packets packets : {Packets::kChoice, Packets::kAll}) {
    const SystemModel model = small_model(true);
    std::vector<bool> attacked(40, false);
    for (std::size_t i = 20; i < 40; ++i) attacked[i] = true;
    const Gaussian strong{Eigen::Vector2d(4.0, -4.0), 0.01 * Eigen::Matrix2d::Identity()};
    const Path path(model, kStart, strong, attacked, 1);
    InteractingMultipleModel filter(model, two_mode_options(packets), kOneSource);
    double before = 0.0, after = 0.0;
    for (int k = 1; k <= 40; ++k) {
      const double r = filter.step(k, set_at(path, k), kNoInput).attack_probability;
      CHECK(r >= 0.0);
      CHECK(r <= 1.0);
      (k <= 20 ? before : after) += r / 20.0;
    }
    CHECK(before < 0.1);
    CHECK(after > 0.9);
  }
}

TEST_CASE("two modes without a box, or with what is no probability, are refused") {
  const SystemModel model = small_model(true);
  auto options = two_mode_options(Packets::kAll);
  options.packet_box = {};
  CHECK_THROWS_AS(InteractingMultipleModel(model, options, kOneSource), UsageError);
  options.packets = Packets::kChoice;
  CHECK_NOTHROW(InteractingMultipleModel(model, options, kOneSource));
  options.birth_probability = 1.1;
  CHECK_THROWS_AS(InteractingMultipleModel(model, options, kOneSource), UsageError);
}
