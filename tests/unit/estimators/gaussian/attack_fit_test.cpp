// What is assumed of attacks, learnt from readings: the laws of expectation-maximisation.

#include <cmath>

#include "tests/unit/estimators/gaussian/attack_cases.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

// Attacks large enough to be told apart, so that a fit has something to find.
AttackStatistics plain_attacks() {
  AttackStatistics attacks = AttackStatistics::of_size(2);
  attacks.attack_probability = 0.4;
  attacks.dos_probability = 0.25;
  attacks.bias_probability = 0.5;
  attacks.scale_probability = 0.2;
  attacks.bias_mean = Eigen::Vector2d(40.0, -30.0);
  attacks.bias_covariance = Eigen::Vector2d(16.0, 25.0).asDiagonal();
  attacks.scale_mean = 0.6;
  attacks.scale_std = 0.1;
  return attacks;
}

std::vector<Eigen::VectorXd> attacked_readings(const SystemModel& model, int steps,
                                               const AttackStatistics& attacks) {
  auto readings = aircraft_readings(model, steps);
  const RandomStream stream(6, 0, "test/attacks");
  for (std::size_t k = 0; k < readings.size(); ++k) {
    const auto step = static_cast<std::uint32_t>(k);
    Eigen::VectorXd& y = readings[k];
    if (!(stream.uniform(step, 0) < attacks.attack_probability)) continue;
    if (stream.uniform(step, 2) < attacks.dos_probability) {
      y.setZero();
      continue;
    }
    if (stream.uniform(step, 4) < attacks.bias_probability) {
      y += attacks.bias_mean;
      for (int i = 0; i < 2; ++i) {
        y[i] += std::sqrt(attacks.bias_covariance(i, i)) *
                stream.normal(step, 10 + 2 * static_cast<std::uint64_t>(i));
      }
    }
    if (stream.uniform(step, 6) < attacks.scale_probability) {
      y *= attacks.scale_mean + attacks.scale_std * stream.normal(step, 20);
    }
  }
  return readings;
}

AttackAssumptions wrong_guess() {
  AttackAssumptions guess;
  AttackAssumptions::Period& it = guess.periods.front();
  it.attack_probability = 0.7;
  it.dos_probability = 0.6;
  it.bias_probability = 0.2;
  it.bias = {{10.0, 10.0}, {30.0}, {}};
  it.scale_probability = 0.5;
  it.scale_mean = 0.9;
  it.scale_std = 0.3;
  return guess;
}

void run_over(AttackMixture& filter, const std::vector<Eigen::VectorXd>& readings) {
  for (std::size_t k = 0; k < readings.size(); ++k) {
    const auto step = static_cast<std::int64_t>(k) + 1;
    filter.step(step, set_of(step, readings[k], kPosition), kNoInput);
  }
}

}  // namespace

TEST_CASE("expectation-maximisation climbs, and finds the attacks from a wrong guess") {
  const SystemModel model = aircraft();
  const AttackStatistics truth = plain_attacks();
  const auto readings = attacked_readings(model, 4000, truth);
  for (const int passes : {1, 3}) {
    const AttackMixture first(model, mixture_options(wrong_guess(), passes), kPosition);
    AttackStatistics fitted = first.statistics();
    double before = -1e300;
    for (int round = 0; round < 12; ++round) {
      const auto filter = first.renewed(fitted);
      filter->remember(SmoothingEstimator::kAllSteps);
      filter->prepare_fit();
      run_over(*filter, readings);
      filter->smooth();
      CHECK(filter->log_likelihood() > before - 1e-3);
      before = filter->log_likelihood();
      fitted = filter->fit();
    }
    // Four standard errors of a share of 4000, 1600 or 1200 readings; the magnitudes' own.
    CHECK(fitted.attack_probability == Approx(truth.attack_probability).margin(0.031));
    CHECK(fitted.dos_probability == Approx(truth.dos_probability).margin(0.044));
    CHECK(fitted.bias_probability == Approx(truth.bias_probability).margin(0.058));
    CHECK(fitted.scale_probability == Approx(truth.scale_probability).margin(0.047));
    CHECK(fitted.scale_mean == Approx(truth.scale_mean).margin(4.0 * 0.1 / std::sqrt(240.0)));
    CHECK(fitted.scale_std == Approx(truth.scale_std).margin(4.0 * 0.1 / std::sqrt(480.0)));
    for (int i = 0; i < 2; ++i) {
      const double deviation = std::sqrt(truth.bias_covariance(i, i) + 12.0);
      CHECK(fitted.bias_mean[i] ==
            Approx(truth.bias_mean[i]).margin(4.0 * deviation / std::sqrt(600.0)));
    }
  }
}

TEST_CASE("a vague guess of a bias learns what one reading shows, not the guess's rounding") {
  // By an endless prior a = y - z, whose covariance is Phh + R.
  const Eigen::Vector2d h(30.0, -20.0), y(100.0, 50.0);
  Eigen::Matrix2d R, Phh;
  R << 12.0, 3.0, 3.0, 12.0;
  Phh << 700.0, 100.0, 100.0, 400.0;
  for (const double std : {1e3, 1e6, 1e9}) {
    INFO(std);
    AttackStatistics statistics = plain_attacks();
    statistics.bias_covariance = std * std * Eigen::Matrix2d::Identity();
    Observation<2, 2> observation;
    observation.h = h;
    observation.Phh = Phh;
    AttackFit fit(2);
    std::array<double, kNumAttackHypotheses> probabilities{};
    probabilities[static_cast<std::size_t>(AttackHypothesis::kBiased)] = 1.0;
    fit.add<2, 2>(observation, R, SizedAttackStatistics<2>(statistics), statistics, probabilities,
                  y);
    fit.maximise(statistics);
    CHECK(statistics.bias_mean.isApprox(y - h, 2e3 / (std * std) + 1e-12));
    CHECK(statistics.bias_covariance.isApprox(Phh + R, 2e3 / (std * std) + 1e-12));
  }
}

TEST_CASE("without a reading a fit keeps what it was told") {
  const SystemModel model = aircraft();
  const AttackMixture first(model, mixture_options(wrong_guess()), kPosition);
  const auto filter = first.renewed(first.statistics());
  filter->remember(SmoothingEstimator::kAllSteps);
  filter->prepare_fit();
  for (int k = 1; k < 5; ++k) filter->step(k, empty_set(k), kNoInput);
  filter->smooth();
  const AttackStatistics fitted = filter->fit();
  CHECK(fitted.attack_probability == first.statistics().attack_probability);
  CHECK(fitted.bias_mean == first.statistics().bias_mean);
  CHECK(fitted.scale_std == first.statistics().scale_std);
}

TEST_CASE("a filter that learns gets from a wrong guess to where the right one is") {
  const SystemModel model = aircraft();
  const AttackStatistics truth = plain_attacks();
  const auto readings = attacked_readings(model, 3000, truth);
  AttackMixtureOptions options = mixture_options(wrong_guess());
  options.learn_over_steps = 500.0;
  AttackMixture learning(model, options, kPosition);
  AttackMixture stubborn(model, mixture_options(wrong_guess()), kPosition);
  for (AttackMixture* filter : {&learning, &stubborn}) run_over(*filter, readings);
  const AttackStatistics& learnt = learning.statistics();
  // As many effective readings as it remembers, less what is attacked.
  CHECK(learnt.attack_probability == Approx(truth.attack_probability).margin(0.09));
  CHECK(learnt.dos_probability == Approx(truth.dos_probability).margin(0.125));
  CHECK(learnt.scale_mean == Approx(truth.scale_mean).margin(0.08));
  CHECK(learnt.bias_mean[0] == Approx(truth.bias_mean[0]).margin(3.0));
  CHECK(stubborn.statistics().attack_probability == 0.7);
  CHECK(learning.log_likelihood() > stubborn.log_likelihood() + 100.0);
}
