#include "estimators/joint_input_state.h"

#include <cmath>

#include "common/chi_square.h"
#include "common/errors.h"
#include "estimators/kalman_filter.h"
#include "tests/unit/estimators/baselines/baseline_cases.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

JointInputStateOptions joint_options(double prior_std = 3.0, double prior_mean = 1.0) {
  JointInputStateOptions options;
  options.start = kStartOptions;
  options.attack_prior = {{prior_mean, -prior_mean}, {prior_std}, {}};
  options.vector.packet = PacketRule::kFirst;
  return options;
}

}  // namespace

TEST_CASE("the joint filter is the conditional Gaussian of state and input") {
  for (const bool is_direct : {true, false}) {
    const SystemModel model = small_model(is_direct);
    const std::vector<bool> attacked(7, true);
    const Path path(model, kStart, kPrior, attacked, 1);
    for (const SystemModel& variant : {model, as_functions(model)}) {
      JointInputState filter(variant, joint_options(), kTwoSources);
      Batch batch(model, kStart, kPrior, attacked);
      for (int k = 1; k <= 7; ++k) {
        MeasurementSet set = empty_set(k);
        for (const int source : {0, 1}) {
          if (k == 4 || (k == 5 && source == 0)) continue;
          const std::vector<int>& rows = kTwoSources[static_cast<std::size_t>(source)];
          add_packet(set, source, part_of(path.y[static_cast<std::size_t>(k - 1)], rows));
          batch.observe(k, rows, path.y[static_cast<std::size_t>(k - 1)]);
        }
        const Estimate& estimate = filter.step(k, set, kNoInput);
        CHECK(estimate.input_step == (is_direct ? k : k - 1));
        CHECK(difference(estimate, batch.posterior(k)) < 1e-12);
        if (estimate.input_step == 0) continue;  // before the first step: the prior
        const Gaussian joint = batch.posterior(k, static_cast<int>(estimate.input_step));
        CHECK(difference(estimate.input_mean, joint.mean.tail(2)) < 1e-12);
        CHECK(difference(estimate.input_covariance, joint.covariance.bottomRightCorner(2, 2)) <
              1e-12);
      }
    }
  }
}

TEST_CASE("with a prior that says no attack the joint filter is the Kalman filter") {
  for (const bool is_direct : {true, false}) {
    const SystemModel model = small_model(is_direct);
    const Path path(model, kStart, kPrior, std::vector<bool>(6, true), 2);
    JointInputState joint(model, joint_options(1e-9, 0.0), kOneSource);
    KalmanFilterOptions options;
    options.start = joint_options().start;
    KalmanFilter kalman(model, options, kOneSource);
    for (int k = 1; k <= 6; ++k) {
      const Estimate& wanted = kalman.step(k, set_at(path, k), kNoInput);
      const Estimate& estimate = joint.step(k, set_at(path, k), kNoInput);
      CHECK(difference(estimate, {wanted.mean, wanted.covariance}) < 1e-12);
    }
  }
}

TEST_CASE("the joint filter's errors have its covariance; with a prior four times too sure not") {
  for (const bool is_direct : {true, false}) {
    const SystemModel model = small_model(is_direct);
    const int runs = 200, steps = 6;
    const auto sum_of_nees = [&](double prior_std) {
      double sum = 0.0;
      for (int run = 0; run < runs; ++run) {
        const Path path(model, kStart, kPrior, std::vector<bool>(steps, true),
                        static_cast<std::uint32_t>(run));
        JointInputState filter(model, joint_options(prior_std), kOneSource);
        for (int k = 1; k < steps; ++k) filter.step(k, set_at(path, k), kNoInput);
        // The last packet is lost: what is left is the prior's honesty.
        const Estimate& estimate = filter.step(steps, empty_set(steps), kNoInput);
        sum += nees(path.x[steps - 1], estimate.mean, estimate.covariance);
      }
      return sum;
    };
    const double low = chi_square_quantile(0.5e-4, 3.0 * runs);
    const double high = chi_square_quantile(1.0 - 0.5e-4, 3.0 * runs);
    const double honest = sum_of_nees(3.0);
    CHECK(honest > low);
    CHECK(honest < high);
    CHECK(sum_of_nees(0.75) > high);
  }
}

TEST_CASE("the joint filter's score: uniform without attack, the prior's pull taken out") {
  const SystemModel model = small_model(true);
  const int runs = 400;
  double sum = 0.0, sum_attacked = 0.0;
  for (int run = 0; run < runs; ++run) {
    for (const bool is_attacked : {false, true}) {
      const Path path(model, kStart, {Eigen::Vector2d(6.0, -5.0), Eigen::Matrix2d::Identity()},
                      {is_attacked}, static_cast<std::uint32_t>(run));
      JointInputState filter(model, joint_options(1e4, 500.0), kOneSource);
      const double score = filter.step(1, set_at(path, 1), kNoInput).attack_probability;
      (is_attacked ? sum_attacked : sum) += score;
    }
  }
  CHECK(sum / runs == Approx(0.5).margin(4.0 / std::sqrt(12.0 * runs)));
  CHECK(sum_attacked / runs > 0.999);
  // No data, no score: the last one stands.
  JointInputState silent(model, joint_options(1.0, 50.0), kOneSource);
  CHECK(silent.step(1, empty_set(1), kNoInput).attack_probability == 0.0);
}

TEST_CASE("a joint filter without a proper prior of the attack is refused") {
  const SystemModel model = small_model(true);
  CHECK_THROWS_AS(JointInputState(model, joint_options(0.0), kOneSource), UsageError);
  JointInputStateOptions options = joint_options();
  options.attack_prior.mean = {1.0};
  CHECK_THROWS_AS(JointInputState(model, options, kOneSource), UsageError);
}
