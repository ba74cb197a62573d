#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "tests/unit/estimators/baselines/every_baseline.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

bool is_symmetric_positive(const Eigen::MatrixXd& P) {
  return P == P.transpose() && P.llt().info() == Eigen::Success;
}

// A single Gaussian for reading and attack together has no opinion.
bool gives_no_probability(const Subject& subject) {
  return subject.name == "gslr";
}

}  // namespace

TEST_CASE("a packet with NaN, infinity, a wrong size or source is refused, counted and harmless") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const SystemModel model = small_model(true);
  std::vector<Subject> dirty = every_baseline(model, kOneSource);
  std::vector<Subject> clean = every_baseline(model, kOneSource);
  for (std::size_t i = 0; i < dirty.size(); ++i) {
    INFO(dirty[i].name);
    for (int k = 1; k <= 5; ++k) {
      MeasurementSet set = empty_set(k);
      add_packet(set, 0, {1.0, nan, 0.0, 0.0});
      add_packet(set, 0, {infinity, 1.0, 0.0, 0.0});
      add_packet(set, 0, {1.0, 2.0, 3.0});
      add_packet(set, 7, {1.0, 2.0, 3.0, 4.0});
      add_packet(set, -1, {1.0, 2.0, 3.0, 4.0});
      add_packet(set, 0, {1.0, 1e101, 3.0, 4.0});
      const MeasurementSet good = set_of(k, reading(k), kOneSource);
      add_packet(set, 0, part_of(reading(k), kOneSource[0]));
      add_packet(set, 0, {0.0, 0.0, 0.0, -infinity});
      const Estimate& estimate = dirty[i].estimator->step(k, set, kNoInput);
      const Estimate& wanted = clean[i].estimator->step(k, good, kNoInput);
      CHECK(estimate.outcome == StepOutcome::kRefusedInput);
      CHECK(wanted.outcome == StepOutcome::kOk);
      CHECK(estimate.mean == wanted.mean);
      CHECK(estimate.covariance == wanted.covariance);
      CHECK(estimate.attack_probability == wanted.attack_probability);
    }
    CHECK(dirty[i].refused() == 35);
    CHECK(clean[i].refused() == 0);
  }
}

TEST_CASE("an empty set predicts only, and a set of refused packets does the same") {
  for (const bool is_direct : {true, false}) {
    const SystemModel model = small_model(is_direct);
    for (Subject& subject : every_baseline(model, kOneSource)) {
      INFO(subject.name);
      const bool knows_attack =
          subject.name == "joint_input_state" || subject.name == "interacting_multiple_model";
      const Estimate& first = subject.estimator->step(1, empty_set(1), kNoInput);
      CHECK(first.outcome == StepOutcome::kNoPackets);
      CHECK(first.mean == Eigen::VectorXd::Zero(3));
      CHECK(difference(first.covariance, Eigen::MatrixXd::Identity(3, 3)) < 1e-15);
      const Estimate& second = subject.estimator->step(2, empty_set(2), kNoInput);
      CHECK(second.mean.norm() < 1e-15);
      const Eigen::MatrixXd wanted = model.A * model.A.transpose() + model.Q;
      const double more = (second.covariance - wanted).trace();
      CHECK((knows_attack ? more > 1e-3 : std::abs(more) < 1e-14));  // what an attack may have done
      CHECK((second.attack_probability >= 0.0 || gives_no_probability(subject)));
    }
  }
}

TEST_CASE("storms and absurd values leave finite, positive beliefs that find back") {
  const SystemModel model = small_model(true);
  for (Subject& subject : every_baseline(model, kTwoSources)) {
    INFO(subject.name);
    for (int k = 1; k <= 60; ++k) {
      MeasurementSet set = empty_set(k);
      if (k == 5) {
        for (int i = 0; i < 500; ++i) add_packet(set, i % 2, {1e99 * (i % 3 - 1), 1e6 * i});
      } else {
        set = set_of(k, reading(k), kTwoSources);
      }
      const Estimate& estimate = subject.estimator->step(k, set, kNoInput);
      REQUIRE(estimate.mean.allFinite());
      REQUIRE(estimate.covariance.allFinite());
      if (k != 5) CHECK(is_symmetric_positive(estimate.covariance));
      CHECK((estimate.attack_probability >= 0.0 || gives_no_probability(subject)));
      CHECK(estimate.attack_probability <= 1.0);
    }
  }
}

TEST_CASE("a plant without attack channels is watched, but has no attack to find") {
  const SystemModel model = small_model(true).with_attack_channels({});
  KalmanFilterOptions kalman_options;
  KalmanFilter kalman(model, kalman_options, kOneSource);
  KalmanFilter with_channels(small_model(true), kalman_options, kOneSource);
  ProbabilisticDataAssociationOptions association_options;
  association_options.packet_box = {std::vector<double>(4, -5.0), std::vector<double>(4, 5.0)};
  ProbabilisticDataAssociation association(model, association_options, kOneSource);
  for (int k = 1; k <= 3; ++k) {
    const MeasurementSet set = set_of(k, reading(k), kOneSource);
    CHECK(kalman.step(k, set, kNoInput).mean == with_channels.step(k, set, kNoInput).mean);
    CHECK(association.step(k, set, kNoInput).mean.allFinite());
  }
  CHECK_THROWS_AS(JointInputState(model, {}, kOneSource), UsageError);
  InteractingMultipleModelOptions modes;
  modes.packet_box = association_options.packet_box;
  CHECK_THROWS_AS(InteractingMultipleModel(model, modes, kOneSource), UsageError);
}

TEST_CASE("linear functions instead of matrices change nothing") {
  for (const bool is_direct : {true, false}) {
    const SystemModel model = small_model(is_direct);
    std::vector<Subject> matrices = every_baseline(model, kTwoSources);
    std::vector<Subject> functions = every_baseline(as_functions(model), kTwoSources);
    for (std::size_t i = 0; i < matrices.size(); ++i) {
      INFO(matrices[i].name);
      for (int k = 1; k <= 8; ++k) {
        const MeasurementSet set = set_of(k, reading(k), kTwoSources);
        const Estimate& wanted = matrices[i].estimator->step(k, set, kNoInput);
        const Estimate& estimate = functions[i].estimator->step(k, set, kNoInput);
        CHECK(difference(estimate, {wanted.mean, wanted.covariance}) < 1e-12);
        CHECK(estimate.attack_probability == Approx(wanted.attack_probability).margin(1e-11));
      }
    }
  }
}

TEST_CASE("options of the baselines are read, checked and resolved") {
  const SystemModel model = small_model(true);
  const auto read = [&](auto options, const std::string& text) {
    ConfigurationDocument document = ConfigurationDocument::from_text(text, "test.yaml");
    ConfigurationMap map = document.root();
    options.read(map, model);
    document.finish();
    return options;
  };
  const auto kalman =
      read(KalmanFilterOptions{},
           "packet: mean\ngate_probability: 0.99\nstart: {mean: [1, 2, 3], std: 4}");
  CHECK(kalman.vector.packet == PacketRule::kMean);
  CHECK(kalman.vector.gate_probability == 0.99);
  CHECK(kalman.start.mean == std::vector<double>{1.0, 2.0, 3.0});
  CHECK(kalman.start.gaussian(3).covariance == 16.0 * Eigen::MatrixXd::Identity(3, 3));
  const auto joint = read(JointInputStateOptions{},
                          "attack_prior: {mean: 5, covariance: [[2, 1], [1, 2]]}\n"
                          "feedthrough: delayed");
  CHECK(joint.feedthrough == Feedthrough::kDelayed);
  CHECK(joint.attack_prior.gaussian(2).covariance(0, 1) == 1.0);
  CHECK(joint.attack_prior.gaussian(2).mean[1] == 5.0);
  const auto pda = read(ProbabilisticDataAssociationOptions{},
                        "packet_box: {low: -1, high: [1, 2, 3, 4]}\ndelivery_probability: 0.5");
  CHECK(pda.packet_box.low == std::vector<double>(4, -1.0));
  CHECK(pda.packet_box.high.at(3) == 4.0);
  const auto modes = read(InteractingMultipleModelOptions{},
                          "packets: choice\npacket: nearest\n"
                          "start: {mean: 1, std: 2, attack_probability: 0.25}");
  CHECK(modes.vector.packet == PacketRule::kNearest);
  CHECK(modes.start_attack_probability == 0.25);

  const auto refused = [&](auto options, const std::string& text) {
    CHECK_THROWS_AS(read(options, text), ConfigurationError);
  };
  refused(KalmanFilterOptions{}, "packet: best");
  refused(KalmanFilterOptions{}, "gate_probability: 0");
  refused(KalmanFilterOptions{}, "start: {mean: [1, 2]}");
  refused(KalmanFilterOptions{}, "start: {covariance: [[1, 0], [0, 1]]}");
  refused(KalmanFilterOptions{}, "start: {covariance: [[1, 2, 0], [2, 1, 0], [0, 0, 1]]}");
  refused(KalmanFilterOptions{}, "packet_box: {low: -1, high: 1}");
  refused(ProbabilisticDataAssociationOptions{}, "delivery_probability: 0.5");
  refused(ProbabilisticDataAssociationOptions{}, "packet_box: {low: 1, high: 1}");
  refused(InteractingMultipleModelOptions{}, "packets: choice\npacket: all");
}
