#include "estimators/attack_fit.h"

#include <algorithm>
#include <cmath>

namespace holdfast {
namespace {

double ratio(double part, double whole, double fallback) {
  return whole > 0.0 ? std::clamp(part / whole, 0.0, 1.0) : fallback;
}

}  // namespace

AttackFit::AttackFit(int num_measurements)
    : bias_sum_(Eigen::VectorXd::Zero(num_measurements)),
      bias_second_(Eigen::MatrixXd::Zero(num_measurements, num_measurements)) {}

void AttackFit::forget(double factor) {
  for (double* sum : {&num_readings_, &num_attacked_, &num_falsified_, &num_biased_, &num_scaled_,
                      &bias_weight_, &scale_weight_, &scale_sum_, &scale_second_}) {
    *sum *= factor;
  }
  bias_sum_ *= factor;
  bias_second_ *= factor;
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
  bias_weight_ += weight;
  bias_sum_ += weight * mean;
  bias_second_ += weight * covariance;
  bias_second_.noalias() += (weight * mean) * mean.transpose();
}

void AttackFit::add_scale(double weight, double mean, double variance) {
  scale_weight_ += weight;
  scale_sum_ += weight * mean;
  scale_second_ += weight * (variance + mean * mean);
}

AttackStatistics AttackFit::maximise(const AttackStatistics& current) const {
  AttackStatistics fitted = current;
  fitted.attack_probability = ratio(num_attacked_, num_readings_, current.attack_probability);
  fitted.dos_probability =
      ratio(num_attacked_ - num_falsified_, num_attacked_, current.dos_probability);
  fitted.bias_probability = ratio(num_biased_, num_falsified_, current.bias_probability);
  fitted.scale_probability = ratio(num_scaled_, num_falsified_, current.scale_probability);
  if (bias_weight_ > 0.0) {
    fitted.bias_mean = bias_sum_ / bias_weight_;
    fitted.bias_covariance =
        bias_second_ / bias_weight_ - fitted.bias_mean * fitted.bias_mean.transpose();
  }
  if (scale_weight_ > 0.0) {
    fitted.scale_mean = scale_sum_ / scale_weight_;
    fitted.scale_std = std::sqrt(
        std::max(0.0, scale_second_ / scale_weight_ - fitted.scale_mean * fitted.scale_mean));
  }
  return fitted;
}

}  // namespace holdfast
