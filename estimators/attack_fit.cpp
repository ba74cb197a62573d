#include "estimators/attack_fit.h"

#include <algorithm>
#include <cmath>

#include "estimators/small_matrix.h"

namespace holdfast {
namespace {

void set_ratio(double part, double whole, double& probability) {
  if (whole > 0.0) probability = std::clamp(part / whole, 0.0, 1.0);
}

}  // namespace

AttackFit::AttackFit(int num_measurements)
    : bias_mean_(Eigen::VectorXd::Zero(num_measurements)),
      bias_apart_(num_measurements),
      bias_scatter_(Eigen::MatrixXd::Zero(num_measurements, num_measurements)) {}

void AttackFit::forget(double factor) {
  for (double* sum : {&num_readings_, &num_attacked_, &num_falsified_, &num_biased_, &num_scaled_,
                      &bias_weight_, &scale_weight_, &scale_scatter_}) {
    *sum *= factor;
  }
  bias_scatter_ *= factor;
}

void AttackFit::add_guess(const AttackStatistics& guess, double num_readings) {
  const double attacked = num_readings * guess.attack_probability;
  const double falsified = attacked * (1.0 - guess.dos_probability);
  num_readings_ += num_readings;
  num_attacked_ += attacked;
  num_falsified_ += falsified;
  num_biased_ += falsified * guess.bias_probability;
  num_scaled_ += falsified * guess.scale_probability;
  add_bias(falsified * guess.bias_probability, guess.bias_mean, guess.bias_covariance);
  add_scale(falsified * guess.scale_probability, guess.scale_mean,
            guess.scale_std * guess.scale_std);
}

// An untouched reading may have been attacked by an attack that did nothing to it.
void AttackFit::add_counts(const AttackStatistics& statistics,
                           const std::array<double, kNumAttackHypotheses>& probabilities) {
  const auto of = [&probabilities](AttackHypothesis hypothesis) {
    return probabilities[static_cast<std::size_t>(hypothesis)];
  };
  const double idle = statistics.attack_probability * (1.0 - statistics.dos_probability) *
                      (1.0 - statistics.bias_probability) * (1.0 - statistics.scale_probability);
  const double untouched = 1.0 - statistics.attack_probability + idle;
  const double idle_now =
      untouched > 0.0 ? of(AttackHypothesis::kUntouched) * idle / untouched : 0.0;
  const double biased = of(AttackHypothesis::kBiased), scaled = of(AttackHypothesis::kScaled);
  const double both = of(AttackHypothesis::kBoth);
  const double falsified = idle_now + biased + scaled + both;
  num_readings_ += 1.0;
  num_falsified_ += falsified;
  num_attacked_ += falsified + of(AttackHypothesis::kForcedToZero);
  num_biased_ += biased + both;
  num_scaled_ += scaled + both;
}

void AttackFit::add_bias(double weight, const Eigen::Ref<const Eigen::VectorXd>& mean,
                         const Eigen::Ref<const Eigen::MatrixXd>& covariance) {
  if (!(weight > 0.0)) return;
  const double earlier = bias_weight_;
  bias_weight_ += weight;
  bias_apart_ = mean - bias_mean_;
  bias_mean_ += (weight / bias_weight_) * bias_apart_;
  bias_scatter_ += weight * covariance;
  bias_apart_ *= std::sqrt(weight * earlier / bias_weight_);
  bias_scatter_.noalias() += bias_apart_ * bias_apart_.transpose();
}

void AttackFit::add_scale(double weight, double mean, double variance) {
  if (!(weight > 0.0)) return;
  const double earlier = scale_weight_, apart = mean - scale_mean_;
  scale_weight_ += weight;
  scale_mean_ += weight / scale_weight_ * apart;
  scale_scatter_ += weight * variance + weight * earlier / scale_weight_ * apart * apart;
}

void AttackFit::maximise(AttackStatistics& statistics) const {
  set_ratio(num_attacked_, num_readings_, statistics.attack_probability);
  set_ratio(num_attacked_ - num_falsified_, num_attacked_, statistics.dos_probability);
  set_ratio(num_biased_, num_falsified_, statistics.bias_probability);
  set_ratio(num_scaled_, num_falsified_, statistics.scale_probability);
  if (bias_weight_ > 0.0) {
    statistics.bias_mean = bias_mean_;
    statistics.bias_covariance = bias_scatter_ / bias_weight_;
    symmetrise_small(statistics.bias_covariance);
  }
  if (scale_weight_ > 0.0) {
    statistics.scale_mean = scale_mean_;
    statistics.scale_std = std::sqrt(std::max(0.0, scale_scatter_ / scale_weight_));
  }
}

}  // namespace holdfast
