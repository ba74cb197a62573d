#pragma once

#include <algorithm>
#include <numbers>

#include "estimators/attacked_reading.h"

namespace holdfast {

/// Update by a reading that one of the attack hypotheses explains: a Kalman update for each,
/// weighed by prior and likelihood in the log domain, and collapsed to one Gaussian with the same
/// two moments (GPB1, Ackerson and Fu 1970, on attack hypotheses).
template <int N, int L>
class AttackHypotheses {
 public:
  /// What one update found.
  struct Result {
    bool is_usable = false;    // some hypothesis explains the reading; else the prior stands
    double log_density = 0.0;  // of y, by all hypotheses; by the mass at zero when y is zero
  };

  /// zero_std: standard deviation of what a forced sensor shows, 0: exactly zero, which proves DoS.
  AttackHypotheses(const AttackStatistics& statistics, double zero_std)
      : attack_(statistics), zero_std_(zero_std) {
    believe(statistics);
    forget();
  }

  const SizedAttackStatistics<L>& attack() const { return attack_; }
  /// Takes other beliefs; what the latest update found stands.
  void believe(const AttackStatistics& statistics) {
    attack_ = SizedAttackStatistics<L>(statistics);
    for (std::size_t i = 0; i < kNumAttackHypotheses; ++i) {
      log_prior_[i] = std::log(attack_.prior[i]);
    }
  }

  /// Missing rows of y must be zero. `posterior` may not be `prior`.
  Result update(const Belief<N>& prior, const Observation<N, L>& observation, const Small<L, L>& R,
                const Small<L>& y, Belief<N>& posterior) {
    log_weights_.fill(-kInfinity);
    beliefs_[kZero] = prior;
    const bool is_zero = zero_std_ == 0.0 && attack_.prior[kZero] > 0.0 && (y.array() == 0.0).all();
    if (is_zero) {
      log_weights_[kZero] = log_prior_[kZero];
    } else {
      for (std::size_t i = 0; i < kZero; ++i) {
        if (attack_.prior[i] == 0.0) continue;
        ReadingBelief<L>& reading = readings_[i];
        believe_hypothesis(observation, R, attack_, static_cast<AttackHypothesis>(i), reading);
        const UpdateResult one = update_.weigh(observation, reading, y);
        if (!one.is_definite) continue;
        update_.apply(prior, observation, reading, beliefs_[i]);
        log_weights_[i] = log_prior_[i] + one.log_density;
      }
      if (zero_std_ > 0.0) {
        log_weights_[kZero] = log_prior_[kZero] + zero_log_density(y, observation.num_missing);
      }
    }
    Result result;
    result.is_usable = normalise(result.log_density);
    collapse(prior, result.is_usable, posterior);
    return result;
  }

  /// Posterior probability of each hypothesis, of the latest update.
  const std::array<double, kNumAttackHypotheses>& probabilities() const { return posterior_; }
  /// Logarithm of its prior probability times its density of the latest reading.
  double log_weight(AttackHypothesis hypothesis) const {
    return log_weights_[static_cast<std::size_t>(hypothesis)];
  }
  /// The belief given a hypothesis of the latest update; null where it is ruled out.
  const Belief<N>* given(AttackHypothesis hypothesis) const {
    const auto i = static_cast<std::size_t>(hypothesis);
    return log_weights_[i] > -kInfinity ? &beliefs_[i] : nullptr;
  }
  /// The reading as the most probable hypothesis has it; null where that is DoS.
  const ReadingBelief<L>* likeliest_reading() const {
    const auto i = static_cast<std::size_t>(std::max_element(posterior_.begin(), posterior_.end()) -
                                            posterior_.begin());
    return i == kZero ? nullptr : &readings_[i];
  }
  /// True when the latest update was by a reading that only DoS explains.
  bool is_certainly_forced() const { return posterior_[kZero] == 1.0; }
  /// The prior probabilities stand again, for a step without a reading.
  void forget() {
    posterior_ = attack_.prior;
    log_weights_.fill(-kInfinity);
  }

 private:
  static constexpr std::size_t kZero = static_cast<std::size_t>(AttackHypothesis::kForcedToZero);
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();

  double zero_log_density(const Small<L>& y, int num_missing) const {
    const double variance = zero_std_ * zero_std_;
    return -0.5 * (y.squaredNorm() / variance + static_cast<double>(y.size() - num_missing) *
                                                    std::log(2.0 * std::numbers::pi * variance));
  }

  // Weights to probabilities; false when all are zero, and then the prior ones stand.
  bool normalise(double& log_sum) {
    const double largest = *std::max_element(log_weights_.begin(), log_weights_.end());
    if (!(largest > -kInfinity)) {
      posterior_ = attack_.prior;
      return false;
    }
    double sum = 0.0;
    for (std::size_t i = 0; i < posterior_.size(); ++i) {
      posterior_[i] = std::exp(log_weights_[i] - largest);
      sum += posterior_[i];
    }
    for (double& probability : posterior_) probability /= sum;
    log_sum = largest + std::log(sum);
    return true;
  }

  void collapse(const Belief<N>& prior, bool is_usable, Belief<N>& posterior) {
    if (!is_usable) {
      posterior = prior;
      return;
    }
    posterior.mean.setZero(prior.mean.size());
    for (std::size_t i = 0; i < posterior_.size(); ++i) {
      if (posterior_[i] > 0.0) posterior.mean += posterior_[i] * beliefs_[i].mean;
    }
    posterior.covariance.setZero(prior.mean.size(), prior.mean.size());
    for (std::size_t i = 0; i < posterior_.size(); ++i) {
      if (posterior_[i] == 0.0) continue;
      const Small<N> apart = beliefs_[i].mean - posterior.mean;
      posterior.covariance += posterior_[i] * beliefs_[i].covariance;
      posterior.covariance.noalias() += (posterior_[i] * apart) * apart.transpose();
    }
    symmetrise_small(posterior.covariance);
  }

  SizedAttackStatistics<L> attack_;
  double zero_std_;
  std::array<double, kNumAttackHypotheses> log_prior_{}, log_weights_{}, posterior_{};
  std::array<Belief<N>, kNumAttackHypotheses> beliefs_;
  std::array<ReadingBelief<L>, kZero> readings_;
  GaussianUpdate<N, L> update_;
};

}  // namespace holdfast
