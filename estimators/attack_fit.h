#pragma once

#include "estimators/attacked_reading.h"
#include "estimators/small_factor.h"

namespace holdfast {

/// Expectation-maximisation for AttackStatistics: what readings said of the latent xb, xc, xm, xa,
/// a and m is summed up, and the statistics that make those sums likeliest follow in closed form.
///
/// a and m given a hypothesis are taken as the linear minimum-variance estimates, exact but for the
/// two hypotheses in which m multiplies.
class AttackFit {
 public:
  explicit AttackFit(int num_measurements);

  void clear() { *this = AttackFit(static_cast<int>(bias_mean_.size())); }
  /// Makes all that was summed up count less, for a recursive fit; factor in [0, 1].
  void forget(double factor);

  /// A guess that counts as this many readings.
  void add_guess(const AttackStatistics& guess, double num_readings);
  /// One reading y: what was believed of h before it, by `statistics`, and the posterior
  /// probability of each hypothesis.
  template <int N, int L>
  void add(const Observation<N, L>& observation, const Small<L, L>& R,
           const SizedAttackStatistics<L>& attack, const AttackStatistics& statistics,
           const std::array<double, kNumAttackHypotheses>& probabilities, const Small<L>& y) {
    add_counts(statistics, probabilities);
    for (const AttackHypothesis hypothesis :
         {AttackHypothesis::kBiased, AttackHypothesis::kScaled, AttackHypothesis::kBoth}) {
      const double weight = probabilities[static_cast<std::size_t>(hypothesis)];
      if (!(weight > 0.0) || observation.num_missing > 0) continue;
      ReadingBelief<L> reading;
      believe_hypothesis(observation, R, attack, hypothesis, reading);
      SmallFactor<L> factor;
      if (!factor.factorise(reading.S)) continue;
      const Small<L> nu = y - reading.mean;
      if (hypothesis != AttackHypothesis::kScaled) {
        Small<L, L> gain = reading.c * attack.bias_covariance;  // Cov[a, y] S^-1
        factor.solve_right(gain);
        const Small<L> mean = attack.bias_mean + gain.lazyProduct(nu);
        add_bias(weight, mean,
                 bias_covariance_given(observation, R, attack, hypothesis, reading.c, gain));
      }
      if (hypothesis != AttackHypothesis::kBiased) {
        Small<L> u = observation.h;
        if (hypothesis == AttackHypothesis::kBoth) u += attack.bias_mean;
        Small<1, L> gain = attack.scale_variance * u.transpose();  // Cov[m, y] S^-1
        factor.solve_right(gain);
        add_scale(weight, attack.scale_mean + gain.dot(nu.transpose()),
                  attack.scale_variance * (1.0 - gain.dot(u.transpose())));
      }
    }
  }

  /// Readings that count.
  double num_readings() const { return num_readings_; }
  /// Sets the likeliest statistics, but where no reading says anything. Allocates nothing.
  void maximise(AttackStatistics& statistics) const;

 private:
  // Joseph's form: a difference would drown what a reading shows in a vague guess's rounding.
  template <int N, int L>
  static Small<L, L> bias_covariance_given(const Observation<N, L>& observation,
                                           const Small<L, L>& R,
                                           const SizedAttackStatistics<L>& attack,
                                           AttackHypothesis hypothesis, double c,
                                           const Small<L, L>& gain) {
    SizedAttackStatistics<L> without = attack;
    without.bias_covariance.setZero();
    ReadingBelief<L> rest;  // S - c^2 Sigma_a
    believe_hypothesis(observation, R, without, hypothesis, rest);
    if (hypothesis == AttackHypothesis::kBoth)
      rest.S += attack.scale_variance * attack.bias_covariance;
    const Small<L, L> kept = Small<L, L>::Identity(R.rows(), R.cols()) - c * gain;
    const Small<L, L> prior = kept.lazyProduct(attack.bias_covariance);
    const Small<L, L> noise = gain.lazyProduct(rest.S);
    Small<L, L> covariance = prior.lazyProduct(kept.transpose());
    covariance += noise.lazyProduct(gain.transpose());
    return covariance;
  }

  void add_counts(const AttackStatistics& statistics,
                  const std::array<double, kNumAttackHypotheses>& probabilities);
  void add_bias(double weight, const Eigen::Ref<const Eigen::VectorXd>& mean,
                const Eigen::Ref<const Eigen::MatrixXd>& covariance);
  void add_scale(double weight, double mean, double variance);

  // Expected numbers of readings: all, attacked, of those not forced, of those biased or scaled.
  double num_readings_ = 0.0, num_attacked_ = 0.0, num_falsified_ = 0.0;
  double num_biased_ = 0.0, num_scaled_ = 0.0;
  // Means, and sums of squares about them: without the mean's own square, which would drown little
  // scatter in its rounding.
  double bias_weight_ = 0.0, scale_weight_ = 0.0;
  Eigen::VectorXd bias_mean_, bias_apart_;
  Eigen::MatrixXd bias_scatter_;
  double scale_mean_ = 0.0, scale_scatter_ = 0.0;
};

}  // namespace holdfast
