// Moments of the attacked reading against draws of it: the corrected ones hold, the printed ones
// do not.

#include <Eigen/Cholesky>
#include <cmath>

#include "tests/unit/estimators/gaussian/attack_cases.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

constexpr int kSamples = 1'000'000;

// x, and y made of it as eq. (4) of paper 001 says.
class AttackedDraws {
 public:
  AttackedDraws(const SystemModel& model, const Gaussian& belief, const AttackStatistics& attacks)
      : model_(model), attacks_(attacks), mean_(belief.mean) {
    root_ = belief.covariance.llt().matrixL();
    noise_root_ = model.R.llt().matrixL();
    bias_root_ = attacks.bias_covariance.llt().matrixL();
  }

  void draw(std::uint32_t i, Eigen::Vector4d& x, Eigen::Vector2d& y) const {
    for (std::uint64_t j = 0; j < 4; ++j) x[static_cast<Eigen::Index>(j)] = stream_.normal(i, j);
    x = mean_ + root_ * x;
    y = model_.C * x + noise_root_ * pair(i, 10);
    if (!(stream_.uniform(i, 30) < attacks_.attack_probability)) return;
    if (stream_.uniform(i, 32) < attacks_.dos_probability) {
      y.setZero();
      return;
    }
    if (stream_.uniform(i, 34) < attacks_.bias_probability) {
      y += attacks_.bias_mean + bias_root_ * pair(i, 20);
    }
    if (stream_.uniform(i, 36) < attacks_.scale_probability) {
      y *= attacks_.scale_mean + attacks_.scale_std * stream_.normal(i, 40);
    }
  }

 private:
  Eigen::Vector2d pair(std::uint32_t i, std::uint64_t draw) const {
    return {stream_.normal(i, draw), stream_.normal(i, draw + 1)};
  }

  SystemModel model_;
  AttackStatistics attacks_;
  Eigen::Vector4d mean_;
  Eigen::MatrixXd root_, noise_root_, bias_root_;
  RandomStream stream_{11, 0, "test/attacked_draws"};
};

// Mean of samples, and how many standard errors it lies from what it should be.
struct SampleMean {
  double sum = 0.0, sum_of_squares = 0.0;

  void add(double value) {
    sum += value;
    sum_of_squares += value * value;
  }
  double errors_from(double wanted) const {
    const double mean = sum / kSamples;
    const double variance = sum_of_squares / kSamples - mean * mean;
    return std::abs(mean - wanted) / std::sqrt(variance / kSamples);
  }
};

}  // namespace

TEST_CASE("exact moments hold for a million draws, the printed variance does not") {
  const SystemModel model = aircraft();
  Gaussian belief{Eigen::Vector4d(200.0, 200.0, 15.0, 15.0), Eigen::MatrixXd::Identity(4, 4)};
  belief.covariance(0, 0) = belief.covariance(1, 1) = 2.0;
  belief.covariance(0, 1) = belief.covariance(1, 0) = 0.5;
  const AttackStatistics attacks = aircraft_attacks().periods.front().statistics(2);

  Observation<4, 2> observation;
  observe_linear<4, 2>(model.C, {belief.mean, belief.covariance}, observation);
  ReadingBelief<2> exact, paper;
  const SizedAttackStatistics<2> sized(attacks);
  regress_reading<4, 2>(observation, model.R, sized, RegressionMoments::kExact, exact);
  regress_reading<4, 2>(observation, model.R, sized, RegressionMoments::kPaper, paper);

  // The largest of all elements is compared: 2 + 4 + 8 of them, so 5 standard errors are beyond
  // chance (10^-5).
  SampleMean mean[2], second[2][2], cross[4][2];
  const AttackedDraws draws(model, belief, attacks);
  Eigen::Vector4d x;
  Eigen::Vector2d y;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    draws.draw(i, x, y);
    x -= belief.mean;
    for (int r = 0; r < 2; ++r) {
      mean[r].add(y[r]);
      for (int c = 0; c < 2; ++c) {
        second[r][c].add((y[r] - exact.mean[r]) * (y[c] - exact.mean[c]));
      }
      for (int n = 0; n < 4; ++n) cross[n][r].add(x[n] * (y[r] - exact.mean[r]));
    }
  }
  double least_for_paper = 1e300;
  for (int r = 0; r < 2; ++r) {
    CHECK(mean[r].errors_from(exact.mean[r]) < 5.0);
    for (int c = 0; c < 2; ++c) {
      CHECK(second[r][c].errors_from(exact.S(r, c)) < 5.0);
      least_for_paper = std::min(least_for_paper, second[r][c].errors_from(paper.S(r, c)));
    }
    for (int n = 0; n < 4; ++n) {
      CHECK(cross[n][r].errors_from(exact.c * observation.Pxh(n, r)) < 5.0);
    }
  }
  CHECK(least_for_paper > 500.0);
  CHECK(paper.mean == exact.mean);
}

TEST_CASE("at the aircraft's start the printed variance is 13.7 times too large") {
  const SystemModel model = aircraft();
  const SizedAttackStatistics<2> attacks(aircraft_attacks().periods.front().statistics(2));
  const Gaussian belief{Eigen::Vector4d(200.0, 200.0, 15.0, 15.0),
                        Eigen::Vector4d(2.0, 2.0, 1.0, 1.0).asDiagonal()};
  Observation<4, 2> observation;
  observe_linear<4, 2>(model.C, {belief.mean, belief.covariance}, observation);
  ReadingBelief<2> exact, paper;
  regress_reading<4, 2>(observation, model.R, attacks, RegressionMoments::kExact, exact);
  regress_reading<4, 2>(observation, model.R, attacks, RegressionMoments::kPaper, paper);
  // The method's page gives m^2, in whole numbers, of the first axis.
  CHECK(exact.S(0, 0) == Approx(1188.0).margin(0.5));
  CHECK(paper.S(0, 0) == Approx(16249.0).margin(0.5));
  CHECK(paper.S.trace() / exact.S.trace() == Approx(13.7).margin(0.05));
}
