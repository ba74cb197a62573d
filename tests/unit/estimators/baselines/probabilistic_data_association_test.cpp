#include "estimators/probabilistic_data_association.h"

#include <cmath>

#include "common/errors.h"
#include "estimators/kalman_filter.h"
#include "tests/unit/estimators/baselines/baseline_cases.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

ProbabilisticDataAssociationOptions association_options(double pd) {
  ProbabilisticDataAssociationOptions options;
  options.start = kStartOptions;
  options.delivery_probability = pd;
  options.packet_box = {{-5.0, -6.0, -7.0, -8.0}, {5.0, 6.0, 7.0, 8.0}};
  return options;
}

const double kVolume = 10.0 * 12.0 * 14.0 * 16.0;

Path path_of(const SystemModel& model, int steps, std::uint32_t run) {
  return Path(model, kStart, centred(Eigen::Matrix2d::Identity()),
              std::vector<bool>(static_cast<std::size_t>(steps), false), run);
}

}  // namespace

TEST_CASE("data association without clutter and with one packet is the Kalman filter") {
  const SystemModel model = small_model(true);
  const Path path = path_of(model, 6, 0);
  KalmanFilterOptions options;
  options.start = association_options(1.0).start;
  KalmanFilter kalman(model, options, kOneSource);
  ProbabilisticDataAssociation sure(model, association_options(1.0), kOneSource);
  ProbabilisticDataAssociation doubting(model, association_options(0.9), kOneSource);
  double doubt = 0.0;
  for (int k = 1; k <= 6; ++k) {
    const MeasurementSet set = k == 3 ? empty_set(k) : set_of(k, path.y[k - 1], kOneSource);
    const Estimate& wanted = kalman.step(k, set, kNoInput);
    const Gaussian kalman_belief{wanted.mean, wanted.covariance};
    const Estimate& estimate = sure.step(k, set, kNoInput);
    CHECK(difference(estimate, kalman_belief) < 1e-12);
    CHECK(estimate.packet_probability == std::vector<double>(set.packets.size(), 1.0));
    CHECK(estimate.attack_probability == Approx(wanted.attack_probability));
    doubt = std::max(doubt, difference(doubting.step(k, set, kNoInput), kalman_belief));
  }
  CHECK(doubt > 1e-9);
}

TEST_CASE("data association has the moments of the mixture over which packet is true") {
  const SystemModel model = small_model(true);
  const double pd = 0.8;
  std::vector<Eigen::VectorXd> packets;
  packets.push_back(Eigen::Vector4d(1.3, -0.8, 0.2, 1.1));
  packets.push_back(Eigen::Vector4d(0.2, -1.9, 1.4, 0.9));
  packets.push_back(Eigen::Vector4d(2.0, 0.5, -0.6, 2.0));
  MeasurementSet set = empty_set(1);
  // Component i is the belief after packet i alone, component 3 that after none.
  std::vector<double> weights;
  std::vector<Gaussian> components;
  for (const Eigen::VectorXd& y : packets) {
    Batch batch(model, kStart, centred(Eigen::Matrix2d::Identity()), {false});
    batch.observe(1, kOneSource[0], y);
    components.push_back(batch.posterior(1));
    weights.push_back(pd / 3.0 * std::exp(batch.log_likelihood()) * kVolume);
    add_packet(set, 0, part_of(y, kOneSource[0]), 40 + static_cast<std::int64_t>(weights.size()));
  }
  components.push_back(kStart);
  weights.push_back(1.0 - pd);
  double sum = 0.0;
  for (const double weight : weights) sum += weight;
  Gaussian wanted{Eigen::VectorXd::Zero(3), Eigen::MatrixXd::Zero(3, 3)};
  for (std::size_t i = 0; i < 4; ++i) wanted.mean += weights[i] / sum * components[i].mean;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::VectorXd off = components[i].mean - wanted.mean;
    wanted.covariance += weights[i] / sum * (components[i].covariance + off * off.transpose());
  }
  ProbabilisticDataAssociation filter(model, association_options(pd), kOneSource);
  const Estimate& estimate = filter.step(1, set, kNoInput);
  CHECK(difference(estimate, wanted) < 1e-12);
  for (std::size_t i = 0; i < 3; ++i) {
    CHECK(estimate.packet_probability.at(i) == Approx(weights[i] / sum).epsilon(1e-12));
  }
  CHECK(estimate.packet_rx_index == std::vector<std::int64_t>{41, 42, 43});
  CHECK(weights[0] / sum < 0.99);  // none of them is a matter of course
}

TEST_CASE("packets that cannot be the plant's leave the prediction and raise the score") {
  const SystemModel model = small_model(true);
  MeasurementSet set = empty_set(1);
  for (int i = 0; i < 500; ++i) {
    add_packet(set, 0, {1e6 + i, -1e9, 1e99, 3.0});
  }
  ProbabilisticDataAssociation filter(model, association_options(0.9), kOneSource);
  const Estimate& estimate = filter.step(1, set, kNoInput);
  CHECK(estimate.mean == kStart.mean);
  CHECK(difference(estimate.covariance, kStart.covariance) < 1e-15);
  CHECK(estimate.attack_probability == 1.0);
  CHECK(estimate.packet_probability == std::vector<double>(500, 0.0));
}

TEST_CASE("with fakes in the box data association keeps the state, the packets' mean does not") {
  const SystemModel model = small_model(true);
  const int steps = 60;
  const Path path = path_of(model, steps, 7);
  KalmanFilterOptions options;
  options.start = association_options(0.95).start;
  options.vector.packet = PacketRule::kMean;
  KalmanFilter kalman(model, options, kOneSource);
  ProbabilisticDataAssociation filter(model, association_options(0.95), kOneSource);
  const RandomStream stream(5, 0, "test/fakes");
  const auto box = association_options(0.95).packet_box;
  double error = 0.0, kalman_error = 0.0;
  for (int k = 1; k <= steps; ++k) {
    MeasurementSet set = set_of(k, path.y[k - 1], kOneSource);
    for (std::uint64_t fake = 0; fake < 10; ++fake) {
      std::vector<double> values;
      for (std::uint64_t r = 0; r < 4; ++r) {
        const double u = stream.uniform(static_cast<std::uint32_t>(k), 4 * fake + r);
        values.push_back(box.low[r] + u * (box.high[r] - box.low[r]));
      }
      add_packet(set, 0, values);
    }
    error += (filter.step(k, set, kNoInput).mean - path.x[k - 1]).squaredNorm();
    kalman_error += (kalman.step(k, set, kNoInput).mean - path.x[k - 1]).squaredNorm();
  }
  CHECK(error / steps < 0.3);
  CHECK(kalman_error > 5.0 * error);
}

TEST_CASE("two sources are each one's own association") {
  const SystemModel model = small_model(true);
  const Path path = path_of(model, 1, 3);
  // Without correlation between the two sources' noises the order cannot matter for pd = 1.
  ProbabilisticDataAssociation filter(model, association_options(1.0), kTwoSources);
  Batch batch(model, kStart, centred(Eigen::Matrix2d::Identity()), {false});
  batch.observe(1, kOneSource[0], path.y[0]);
  SystemModel uncorrelated = model;
  uncorrelated.R(1, 3) = uncorrelated.R(3, 1) = 0.0;
  ProbabilisticDataAssociation two(uncorrelated, association_options(1.0), kTwoSources);
  Batch one(uncorrelated, kStart, centred(Eigen::Matrix2d::Identity()), {false});
  one.observe(1, kOneSource[0], path.y[0]);
  CHECK(difference(two.step(1, set_of(1, path.y[0], kTwoSources), kNoInput), one.posterior(1)) <
        1e-12);
  CHECK(difference(filter.step(1, set_of(1, path.y[0], kTwoSources), kNoInput),
                   batch.posterior(1)) > 1e-6);  // correlated: taken apart they lose that
}

TEST_CASE("a box without volume or a delivery that never happens is refused") {
  const SystemModel model = small_model(true);
  auto options = association_options(0.0);
  CHECK_THROWS_AS(ProbabilisticDataAssociation(model, options, kOneSource), UsageError);
  options = association_options(0.9);
  options.packet_box.high[2] = options.packet_box.low[2];
  CHECK_THROWS_AS(ProbabilisticDataAssociation(model, options, kOneSource), UsageError);
  options.packet_box = {};
  CHECK_THROWS_AS(ProbabilisticDataAssociation(model, options, kOneSource), UsageError);
}
