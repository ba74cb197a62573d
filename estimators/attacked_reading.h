#pragma once

#include <array>

#include "estimators/attack_statistics.h"
#include "estimators/gaussian_update.h"

namespace holdfast {

/// Which second moment a statistical linear regression of the attacked reading uses.
enum class RegressionMoments {
  kExact,
  kPaper  // as printed in paper 001, without the covariance of xi_b and (1 - xi_b) xi_c (..)
};

/// Statistics of attacks in the sizes of a filter.
template <int L>
struct SizedAttackStatistics {
  explicit SizedAttackStatistics(const AttackStatistics& statistics)
      : moments(statistics),
        prior(attack_hypothesis_probabilities(statistics)),
        clean_probability(1.0 - statistics.attack_probability),
        bias_probability(statistics.bias_probability),
        scale_mean(statistics.scale_mean),
        scale_variance(statistics.scale_std * statistics.scale_std),
        bias_mean(statistics.bias_mean),
        bias_covariance(statistics.bias_covariance) {}

  ScaleMoments moments;
  std::array<double, kNumAttackHypotheses> prior;
  double clean_probability, bias_probability, scale_mean, scale_variance;
  Small<L> bias_mean;
  Small<L, L> bias_covariance;
};

/// The attacked reading as one Gaussian: c = s1, E[y] = s1 h + c1 aa mu_a and S of the method's
/// page, section 2, or as printed. Omega = S - c^2 Phh is formed term by term, so that nothing
/// cancels.
template <int N, int L>
void regress_reading(const Observation<N, L>& observation, const Small<L, L>& R,
                     const SizedAttackStatistics<L>& attack, RegressionMoments moments,
                     ReadingBelief<L>& reading) {
  const ScaleMoments& it = attack.moments;
  const double aa = attack.bias_probability;
  const auto& h = observation.h;
  const auto& mu = attack.bias_mean;
  // 2 ab c1 is what the paper leaves out of the variance of S.
  const double lost = moments == RegressionMoments::kPaper ? attack.clean_probability * it.c1 : 0.0;
  reading.c = it.s1;
  reading.mean = it.s1 * h + (it.c1 * aa) * mu;
  reading.Omega = it.s2 * R;
  reading.Omega += (it.spread + 2.0 * lost) * observation.Phh;
  reading.Omega.noalias() += ((it.spread + 2.0 * lost) * h) * h.transpose();
  const double mixed = aa * (it.c2 - it.s1 * it.c1 + lost);
  reading.Omega.noalias() += (mixed * h) * mu.transpose();
  reading.Omega.noalias() += (mixed * mu) * h.transpose();
  reading.Omega += (it.c2 * aa) * attack.bias_covariance;
  reading.Omega.noalias() += ((it.c2 * aa - it.c1 * aa * it.c1 * aa) * mu) * mu.transpose();
  symmetrise_small(reading.Omega);
  reading.S = (it.s1 * it.s1) * observation.Phh;
  reading.S += reading.Omega;
}

/// The reading given one hypothesis other than kForcedToZero: c = 1 or mu_m; u = h (+ mu_a),
/// V = R (+ Sigma_a); scaled: E[y] = mu_m u, S = (s_m^2 + mu_m^2) (Phh + V) + s_m^2 u u'.
template <int N, int L>
void believe_hypothesis(const Observation<N, L>& observation, const Small<L, L>& R,
                        const SizedAttackStatistics<L>& attack, AttackHypothesis hypothesis,
                        ReadingBelief<L>& reading) {
  const bool is_biased =
      hypothesis == AttackHypothesis::kBiased || hypothesis == AttackHypothesis::kBoth;
  const bool is_scaled =
      hypothesis == AttackHypothesis::kScaled || hypothesis == AttackHypothesis::kBoth;
  believe_reading(observation, R, reading);
  if (is_biased) {
    reading.mean += attack.bias_mean;
    reading.Omega += attack.bias_covariance;
    reading.S += attack.bias_covariance;
  }
  if (!is_scaled) return;
  const double second = attack.scale_variance + attack.scale_mean * attack.scale_mean;
  reading.c = attack.scale_mean;
  reading.Omega *= second;
  reading.Omega += attack.scale_variance * observation.Phh;
  reading.Omega.noalias() += (attack.scale_variance * reading.mean) * reading.mean.transpose();
  reading.S = (reading.c * reading.c) * observation.Phh;
  reading.S += reading.Omega;
  reading.mean *= attack.scale_mean;
}

}  // namespace holdfast
