#include "estimators/kalman_filter.h"

#include <cmath>

#include "common/chi_square.h"
#include "common/errors.h"
#include "common/models/ieee14/ieee14_model.h"
#include "tests/unit/estimators/baselines/baseline_cases.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

KalmanFilterOptions kalman_options(PacketRule rule = PacketRule::kFirst, double gate = 1.0) {
  KalmanFilterOptions options;
  options.start = kStartOptions;
  options.vector = {rule, gate};
  return options;
}

}  // namespace

TEST_CASE("the Kalman filter is the conditional Gaussian of all readings") {
  const SystemModel model = small_model(true);
  const std::vector<bool> attacked(8, false);
  const Path path(model, kStart, centred(Eigen::MatrixXd::Identity(2, 2)), attacked, 0);
  for (const SystemModel& variant : {model, as_functions(model)}) {
    KalmanFilter filter(variant, kalman_options(), kTwoSources);
    Batch batch(model, kStart, centred(Eigen::MatrixXd::Identity(2, 2)), attacked);
    for (int k = 1; k <= 8; ++k) {
      // Both sources, the second alone, none, the first alone, and so on.
      MeasurementSet set = empty_set(k);
      for (const int source : {1, 0}) {
        if ((k + source) % 3 == 0 || k == 3) continue;
        const std::vector<int>& rows = kTwoSources[static_cast<std::size_t>(source)];
        add_packet(set, source, part_of(path.y[static_cast<std::size_t>(k - 1)], rows));
        batch.observe(k, rows, path.y[static_cast<std::size_t>(k - 1)]);
      }
      const Estimate& estimate = filter.step(k, set, kNoInput);
      CHECK(difference(estimate, batch.posterior(k)) < 1e-12);
      CHECK((estimate.outcome == StepOutcome::kNoPackets) == (k == 3));
      CHECK(estimate.innovation.size() == static_cast<Eigen::Index>(set.values.size()));
      CHECK(estimate.step == k);
      CHECK(estimate.utime == 1000 * k);
    }
  }
}

TEST_CASE(
    "the Kalman filter's errors have its covariance; those of one that trusts R / 4 have not") {
  const SystemModel model = small_model(true);
  SystemModel wrong = model;
  wrong.R /= 4.0;
  const int runs = 300;
  const auto sum_of_nees = [&](const SystemModel& belief) {
    double sum = 0.0;
    for (int run = 0; run < runs; ++run) {
      const Path path(model, kStart, centred(Eigen::MatrixXd::Identity(2, 2)),
                      std::vector<bool>(10, false), static_cast<std::uint32_t>(run));
      KalmanFilter filter(belief, kalman_options(), kOneSource);
      for (int k = 1; k <= 10; ++k) {
        const Estimate& estimate = filter.step(
            k, set_of(k, path.y[static_cast<std::size_t>(k - 1)], kOneSource), kNoInput);
        if (k == 10) sum += nees(path.x[9], estimate.mean, estimate.covariance);
      }
    }
    return sum;
  };
  const double low = chi_square_quantile(0.5e-4, 3.0 * runs);
  const double high = chi_square_quantile(1.0 - 0.5e-4, 3.0 * runs);
  const double honest = sum_of_nees(model), sure = sum_of_nees(wrong);
  CHECK(honest > low);
  CHECK(honest < high);
  CHECK(sure > high);
}

TEST_CASE("the Kalman filter's score is uniform without attack and one under a strong one") {
  const SystemModel model = small_model(true);
  const Gaussian prior{Eigen::Vector2d(30.0, 30.0), Eigen::Matrix2d::Identity()};
  const int runs = 400;
  double sum = 0.0, sum_attacked = 0.0;
  for (int run = 0; run < runs; ++run) {
    for (const bool is_attacked : {false, true}) {
      const Path path(model, kStart, prior, {false, is_attacked}, static_cast<std::uint32_t>(run));
      KalmanFilter filter(model, kalman_options(), kOneSource);
      filter.step(1, set_of(1, path.y[0], kOneSource), kNoInput);
      const double score =
          filter.step(2, set_of(2, path.y[1], kOneSource), kNoInput).attack_probability;
      CHECK(score >= 0.0);
      CHECK(score <= 1.0);
      (is_attacked ? sum_attacked : sum) += score;
    }
  }
  // A uniform score has mean 1/2 and variance 1/12; four standard errors.
  CHECK(sum / runs == Approx(0.5).margin(4.0 / std::sqrt(12.0 * runs)));
  CHECK(sum_attacked / runs > 0.999);
}

TEST_CASE("a vector is chosen by its rule") {
  const SystemModel model = small_model(true);
  const Eigen::Vector4d near(1.1, -1.0, 0.6, 1.0), far(9.0, 9.0, 9.0, 9.0),
      farther(-20.0, 0.0, 3.0, 4.0);
  const auto estimate_of = [&](PacketRule rule, double gate, const MeasurementSet& set) {
    KalmanFilter filter(model, kalman_options(rule, gate), kOneSource);
    return filter.step(1, set, kNoInput);
  };
  const auto alone = [&](const Eigen::Vector4d& y) {
    return estimate_of(PacketRule::kFirst, 1.0, set_of(1, y, kOneSource));
  };
  MeasurementSet set = empty_set(1);
  for (const Eigen::Vector4d& y : {far, near, farther})
    add_packet(set, 0, part_of(y, {0, 1, 2, 3}));
  CHECK(estimate_of(PacketRule::kFirst, 1.0, set).mean == alone(far).mean);
  CHECK(estimate_of(PacketRule::kLast, 1.0, set).mean == alone(farther).mean);
  CHECK(estimate_of(PacketRule::kNearest, 1.0, set).mean == alone(near).mean);
  const Eigen::Vector4d mean = (far + near + farther) / 3.0;
  CHECK(difference(estimate_of(PacketRule::kMean, 1.0, set).mean, alone(mean).mean) < 1e-14);
  // Behind a gate that only `near` passes every rule takes it.
  for (const PacketRule rule :
       {PacketRule::kFirst, PacketRule::kLast, PacketRule::kMean, PacketRule::kNearest}) {
    CHECK(estimate_of(rule, 0.999, set).mean == alone(near).mean);
  }
  // Behind one that nothing passes the filter predicts, and the score says how far off all were.
  const Estimate gated = estimate_of(PacketRule::kFirst, 0.999, set_of(1, far, kOneSource));
  CHECK(gated.mean == kStart.mean);
  CHECK(gated.innovation.size() == 0);
  CHECK(gated.attack_probability > 0.999);
  CHECK(gated.attack_probability == Approx(alone(far).attack_probability));
}

TEST_CASE("the gate lets in what its probability says") {
  const SystemModel model = small_model(true);
  int num_in = 0;
  const int runs = 2000;
  for (int run = 0; run < runs; ++run) {
    const Path path(model, kStart, centred(Eigen::MatrixXd::Identity(2, 2)), {false},
                    static_cast<std::uint32_t>(run));
    KalmanFilter filter(model, kalman_options(PacketRule::kNearest, 0.9), kOneSource);
    num_in += filter.step(1, set_of(1, path.y[0], kOneSource), kNoInput).innovation.size() > 0;
  }
  CHECK(num_in == Approx(0.9 * runs).margin(4.0 * std::sqrt(0.09 * runs)));
}

TEST_CASE("the extended Kalman filter moves by the swing equation and its Jacobian") {
  Ieee14Options network;
  network.nonlinear = true;
  const SystemModel model = make_ieee14_model(network);
  KalmanFilterOptions options;
  options.start.mean = {0.9, -0.6, 0.3, -0.2, 0.1, 1.0, -2.0, 0.5, 3.0, -1.0};
  options.start.std = {0.2};
  KalmanFilter filter(model, options, {{0, 1, 2, 3, 4, 5, 6, 7, 8, 9}});
  const Gaussian start = options.start.gaussian(10);
  Eigen::VectorXd next(10);
  Eigen::MatrixXd F(10, 12);
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(2);
  model.move(start.mean, none, next);
  model.move_jacobian(start.mean, none, F);
  filter.step(1, empty_set(1), kNoInput);
  const Estimate& estimate = filter.step(2, empty_set(2), kNoInput);
  const Eigen::MatrixXd wanted =
      F.leftCols(10) * start.covariance * F.leftCols(10).transpose() + model.Q;
  CHECK(estimate.mean == next);
  CHECK(difference(estimate.covariance, wanted) < 1e-14);
  CHECK(difference(next, model.A * start.mean) > 1e-4);  // not the linear model's
}

TEST_CASE("a Kalman filter that does not fit its model is refused") {
  const SystemModel model = small_model(true);
  const auto refused = [&](const KalmanFilterOptions& options, const Rows& rows) {
    CHECK_THROWS_AS(KalmanFilter(model, options, rows), UsageError);
  };
  refused(kalman_options(), {{0, 1}, {1, 2}});
  refused(kalman_options(), {{0, 4}});
  refused(kalman_options(), {{}});
  refused(kalman_options(PacketRule::kFirst, 0.0), kOneSource);
  KalmanFilterOptions options = kalman_options();
  options.start.mean = {1.0};
  refused(options, kOneSource);
  options = kalman_options();
  options.start.covariance = {{1.0, 2.0, 0.0}, {2.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
  refused(options, kOneSource);
  SystemModel wrong = model;
  wrong.R.setZero();
  CHECK_THROWS_AS(KalmanFilter(wrong, kalman_options(), kOneSource), UsageError);
}
