#include "tools/bounds/clairvoyant_filter.h"

#include <limits>

#include "estimators/joint_input_state.h"
#include "estimators/kalman_filter.h"
#include "tests/unit/estimators/baselines/baseline_cases.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

ClairvoyantFilterOptions options_of() {
  ClairvoyantFilterOptions options;
  options.start = kStartOptions;
  options.attack_prior = kPriorOptions;
  return options;
}

MeasurementSet three_of_four(const Path& path, int k) {
  return k % 4 == 0 ? empty_set(k) : set_at(path, k);
}

}  // namespace

TEST_CASE("the clairvoyant filter is the conditional Gaussian for the attack times told") {
  for (const bool is_direct : {true, false}) {
    const SystemModel model = small_model(is_direct);
    const std::vector<bool> attacked = {true, false, true, true, false, false, true, true};
    const Path path(model, kStart, kPrior, attacked, 1);
    ClairvoyantFilter filter(model, options_of(), kTwoSources);
    Batch batch(model, kStart, kPrior, attacked);
    for (int k = 1; k <= 8; ++k) {
      MeasurementSet set = empty_set(k);
      for (const int source : {1, 0}) {
        if ((k + source) % 4 == 0) continue;
        const std::vector<int>& rows = kTwoSources[static_cast<std::size_t>(source)];
        add_packet(set, source, part_of(path.y[static_cast<std::size_t>(k - 1)], rows));
        batch.observe(k, rows, path.y[static_cast<std::size_t>(k - 1)]);
      }
      filter.tell({attacked[static_cast<std::size_t>(k - 1)], {}});
      const Estimate& estimate = filter.step(k, set, kNoInput);
      CHECK(difference(estimate, batch.posterior(k)) < 1e-12);
      CHECK(estimate.input_step == (is_direct ? k : k - 1));
      const auto input_step = static_cast<int>(estimate.input_step);
      const bool is_input_attacked =
          input_step > 0 && attacked[static_cast<std::size_t>(input_step - 1)];
      CHECK(estimate.attack_probability == (is_input_attacked ? 1.0 : 0.0));
      if (!is_input_attacked) {
        CHECK(estimate.input_mean == Eigen::Vector2d::Zero());
        continue;
      }
      const Gaussian joint = batch.posterior(k, input_step);
      CHECK(difference(estimate.input_mean, joint.mean.tail(2)) < 1e-12);
      CHECK(difference(estimate.input_covariance, joint.covariance.bottomRightCorner(2, 2)) <
            1e-12);
    }
  }
}

TEST_CASE("told of no attack it is the Kalman filter, told of one for ever the joint filter") {
  for (const bool is_direct : {true, false}) {
    const SystemModel model = small_model(is_direct);
    const Path path(model, kStart, kPrior, std::vector<bool>(7, true), 2);
    ClairvoyantFilter calm(model, options_of(), kOneSource);
    ClairvoyantFilter alarmed(model, options_of(), kOneSource);
    alarmed.tell({true, {}});
    KalmanFilterOptions kalman_options;
    kalman_options.start = options_of().start;
    KalmanFilter kalman(model, kalman_options, kOneSource);
    JointInputStateOptions joint_options;
    joint_options.start = options_of().start;
    joint_options.attack_prior = options_of().attack_prior;
    JointInputState joint(model, joint_options, kOneSource);
    for (int k = 1; k <= 7; ++k) {
      const Estimate& kalman_says = kalman.step(k, three_of_four(path, k), kNoInput);
      CHECK(difference(calm.step(k, three_of_four(path, k), kNoInput),
                       {kalman_says.mean, kalman_says.covariance}) < 1e-13);
      const Estimate& joint_says = joint.step(k, three_of_four(path, k), kNoInput);
      const Estimate& alarmed_says = alarmed.step(k, three_of_four(path, k), kNoInput);
      CHECK(difference(alarmed_says, {joint_says.mean, joint_says.covariance}) < 1e-13);
      if (is_direct || k > 1) {
        CHECK(difference(alarmed_says.input_mean, joint_says.input_mean) < 1e-13);
      }
    }
  }
}

TEST_CASE("a clairvoyant filter refuses what is not finite all the same") {
  ClairvoyantFilter filter(small_model(true), options_of(), kOneSource);
  MeasurementSet set = empty_set(1);
  add_packet(set, 0, {1.0, std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0});
  const Estimate& estimate = filter.step(1, set, kNoInput);
  CHECK(estimate.outcome == StepOutcome::kRefusedInput);
  CHECK(estimate.mean == kStart.mean);
  CHECK(filter.refused_packets() == 1);
}
