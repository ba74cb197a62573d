// The Gaussian sum over attack hypotheses against all sequences of them, one by one.

#include <cmath>

#include "tests/unit/estimators/gaussian/attack_cases.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

constexpr int kSteps = 4;

AttackMixtureOptions sum_options(int components, double prune_below) {
  AttackMixtureOptions options = mixture_options(aircraft_attacks(), 1);
  options.components_max = components;
  options.prune_below = prune_below;
  options.zero_std = 5.0;  // so that no hypothesis is ruled out
  return options;
}

// Every sequence of hypotheses by itself: weights, and one Kalman filter each.
struct Sequences {
  std::vector<double> log_weights = {0.0};
  std::vector<Belief<4>> beliefs;
  std::vector<std::size_t> last = {0};

  explicit Sequences(const Gaussian& start) : beliefs{{start.mean, start.covariance}} {}

  void step(const SystemModel& model, const AttackStatistics& attacks, double zero_std,
            const Eigen::Vector2d& y, bool is_first) {
    const SizedAttackStatistics<2> sized(attacks);
    Sequences next = *this;
    next.log_weights.clear();
    next.beliefs.clear();
    next.last.clear();
    for (std::size_t i = 0; i < beliefs.size(); ++i) {
      Belief<4> predicted = beliefs[i];
      Small<4, 4> cross;
      if (!is_first) predict_linear<4>(model.A, model.Q, beliefs[i], cross, predicted);
      for (std::size_t h = 0; h < kNumAttackHypotheses; ++h) {
        double log_density = 0.0;
        Belief<4> belief = predicted;
        if (h == static_cast<std::size_t>(AttackHypothesis::kForcedToZero)) {
          const double variance = zero_std * zero_std;
          log_density = -0.5 * y.squaredNorm() / variance - std::log(2.0 * M_PI * variance);
        } else {
          Observation<4, 2> observation;
          observe_linear<4, 2>(model.C, predicted, observation);
          ReadingBelief<2> reading;
          believe_hypothesis<4, 2>(observation, model.R, sized, static_cast<AttackHypothesis>(h),
                                   reading);
          GaussianUpdate<4, 2> update;
          log_density = update.weigh(observation, reading, y).log_density;
          update.apply(predicted, observation, reading, belief);
        }
        next.log_weights.push_back(log_weights[i] + std::log(sized.prior[h]) + log_density);
        next.beliefs.push_back(belief);
        next.last.push_back(h);
      }
    }
    *this = next;
  }

  Gaussian collapsed(std::array<double, kNumAttackHypotheses>& probabilities) const {
    const double largest = *std::max_element(log_weights.begin(), log_weights.end());
    double sum = 0.0;
    for (const double weight : log_weights) sum += std::exp(weight - largest);
    Gaussian whole{Eigen::VectorXd::Zero(4), Eigen::MatrixXd::Zero(4, 4)};
    probabilities.fill(0.0);
    for (std::size_t i = 0; i < beliefs.size(); ++i) {
      const double weight = std::exp(log_weights[i] - largest) / sum;
      whole.mean += weight * beliefs[i].mean;
      whole.covariance +=
          weight * (beliefs[i].covariance + beliefs[i].mean * beliefs[i].mean.transpose());
      probabilities[last[i]] += weight;
    }
    whole.covariance -= whole.mean * whole.mean.transpose();
    return whole;
  }
};

}  // namespace

TEST_CASE("with room for all sequences of hypotheses the sum is exact") {
  const SystemModel model = aircraft();
  auto readings = aircraft_readings(model, kSteps);
  readings[1] *= 0.93;
  readings[2] += Eigen::Vector2d(3.0, 2.0);
  const AttackMixtureOptions options = sum_options(625, 0.0);
  AttackMixture filter(model, options, kPosition);
  Sequences sequences(options.start.gaussian(4));
  double log_likelihood = 0.0;
  for (int k = 1; k <= kSteps; ++k) {
    const Eigen::Vector2d y = readings[static_cast<std::size_t>(k - 1)];
    const Estimate& estimate = filter.step(k, set_of(k, y, kPosition), kNoInput);
    sequences.step(model, options.assumes.periods.front().statistics(2), options.zero_std, y,
                   k == 1);
    std::array<double, kNumAttackHypotheses> probabilities{};
    const Gaussian wanted = sequences.collapsed(probabilities);
    CHECK(difference(estimate.mean, wanted.mean) < 1e-10);
    // Second moments about zero cancel in the other route: (200 m)^2 against 1 m^2.
    CHECK(difference(estimate.covariance, wanted.covariance) < 1e-8);
    for (std::size_t h = 0; h < kNumAttackHypotheses; ++h) {
      CHECK(estimate.mode_probability[h] == Approx(probabilities[h]).margin(1e-10));
    }
    CHECK(estimate.hypotheses[0].num_candidates == static_cast<int>(std::pow(5, k)));
  }
  for (const double weight : sequences.log_weights) {
    log_likelihood = log_likelihood == 0.0
                         ? weight
                         : std::max(log_likelihood, weight) +
                               std::log1p(std::exp(-std::abs(log_likelihood - weight)));
  }
  CHECK(filter.log_likelihood() == Approx(log_likelihood).epsilon(1e-10));
}

TEST_CASE("merging moves neither mean nor covariance; few components come close to all") {
  const SystemModel model = aircraft();
  auto readings = aircraft_readings(model, 40);
  for (std::size_t k = 2; k < 40; k += 5) readings[k] *= 0.95;
  AttackMixtureOptions gpb1 = sum_options(1, 0.0);
  AttackMixture one(model, gpb1, kPosition);
  // Everything is merged into the heaviest: GPB1 by the other road.
  AttackMixture merged(model, sum_options(2, 1.0), kPosition);
  AttackMixture few(model, sum_options(8, 1e-4), kPosition);
  AttackMixture more(model, sum_options(40, 1e-6), kPosition);
  AttackMixture many(model, sum_options(200, 1e-8), kPosition);
  for (AttackMixture* filter : {&one, &merged, &few, &more, &many}) {
    filter->remember(SmoothingEstimator::kAllSteps);
  }
  double apart_one = 0.0, apart_few = 0.0, apart_more = 0.0;
  for (int k = 1; k <= 40; ++k) {
    const MeasurementSet set = set_of(k, readings[static_cast<std::size_t>(k - 1)], kPosition);
    const Estimate& a = one.step(k, set, kNoInput);
    const Estimate& b = merged.step(k, set, kNoInput);
    CHECK(difference(b.mean, a.mean) < 1e-11);
    CHECK(difference(b.covariance, a.covariance) < 1e-10);
    const Estimate& best = many.step(k, set, kNoInput);
    apart_one += (a.mean - best.mean).norm();
    apart_few += (few.step(k, set, kNoInput).mean - best.mean).norm();
    apart_more += (more.step(k, set, kNoInput).mean - best.mean).norm();
  }
  CHECK(apart_few < apart_one);
  CHECK(apart_more < apart_few);
  for (std::size_t k = 0; k < 40; ++k) {
    CHECK(difference(merged.smooth()[k].mean, one.smooth()[k].mean) < 1e-9);
  }
}
