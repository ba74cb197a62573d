#include "estimators/attack_statistics.h"

#include <cmath>

namespace holdfast {
namespace {

bool is_probability(double value) {
  return value >= 0.0 && value <= 1.0;
}

}  // namespace

AttackStatistics AttackStatistics::of_size(int num_measurements) {
  AttackStatistics statistics;
  statistics.bias_mean = Eigen::VectorXd::Zero(num_measurements);
  statistics.bias_covariance = Eigen::MatrixXd::Zero(num_measurements, num_measurements);
  return statistics;
}

bool AttackStatistics::is_valid(int num_measurements) const {
  return is_probability(attack_probability) && is_probability(dos_probability) &&
         is_probability(bias_probability) && is_probability(scale_probability) &&
         bias_mean.size() == num_measurements && bias_covariance.rows() == num_measurements &&
         bias_covariance.cols() == num_measurements && bias_mean.allFinite() &&
         bias_covariance.allFinite() && std::isfinite(scale_mean) && std::isfinite(scale_std) &&
         scale_std >= 0.0;
}

ScaleMoments::ScaleMoments(const AttackStatistics& statistics) {
  const double am = statistics.scale_probability;
  const double mu = statistics.scale_mean;
  const double falsified = statistics.attack_probability * (1.0 - statistics.dos_probability);
  const double clean = 1.0 - statistics.attack_probability;
  c1 = falsified * (1.0 + am * (mu - 1.0));
  c2 = falsified * ((1.0 - am) + am * (statistics.scale_std * statistics.scale_std + mu * mu));
  s1 = clean + c1;
  s2 = clean + c2;
  spread = s2 - s1 * s1;
}

const std::array<std::string, kNumAttackHypotheses>& attack_hypothesis_names() {
  static const std::array<std::string, kNumAttackHypotheses> names = {
      "untouched", "biased", "scaled", "both", "forced_to_zero"};
  return names;
}

std::array<double, kNumAttackHypotheses> attack_hypothesis_probabilities(
    const AttackStatistics& statistics) {
  const double dos = statistics.attack_probability * statistics.dos_probability;
  const double falsified = statistics.attack_probability * (1.0 - statistics.dos_probability);
  const double aa = statistics.bias_probability, am = statistics.scale_probability;
  return {1.0 - statistics.attack_probability + falsified * (1.0 - am) * (1.0 - aa),
          falsified * (1.0 - am) * aa, falsified * am * (1.0 - aa), falsified * am * aa, dos};
}

}  // namespace holdfast
