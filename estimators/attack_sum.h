#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "estimators/attack_hypotheses.h"
#include "estimators/sized_model.h"
#include "estimators/small_factor.h"

namespace holdfast {

/// A Gaussian sum over what was done to the latest readings: every component meets every attack
/// hypothesis, then the lightest are merged into the nearest of those that stay, so that mean and
/// covariance of the whole never change by it. With one component it is GPB1.
///
/// Cost of a step: J components make 5 J candidates, and at most 5 J^2 distances.
template <int N, int L>
class AttackSum {
 public:
  /// prune_below: candidates lighter than this do not choose where they stay.
  AttackSum(std::size_t components_max, double prune_below)
      : components_max_(components_max), prune_below_(prune_below) {
    components_.reserve(components_max);
    candidates_.reserve(components_max * kNumAttackHypotheses);
  }

  std::size_t num_components() const { return components_.size(); }
  std::size_t num_candidates() const { return num_candidates_; }
  /// Posterior probability of each hypothesis about the latest reading.
  const std::array<double, kNumAttackHypotheses>& probabilities() const { return probabilities_; }
  /// What is known of the attack on a reading that did not come.
  void forget(const std::array<double, kNumAttackHypotheses>& prior) { probabilities_ = prior; }

  /// Begins from one Gaussian.
  void start(const Belief<N>& belief) { components_.assign(1, {1.0, belief}); }

  /// Moves every component; `cross` and `predicted` are those of the whole sum.
  void move(SizedModel<N, L>& model, Small<N, N>& cross, Belief<N>& predicted) {
    collapse(components_, before_);
    Small<N, N> sum = Small<N, N>::Zero(before_.mean.size(), before_.mean.size());
    moved_.resize(components_.size());
    for (std::size_t i = 0; i < components_.size(); ++i) {
      moved_[i].weight = components_[i].weight;
      model.predict(components_[i].belief, cross, moved_[i].belief);
      sum += moved_[i].weight * cross;
    }
    collapse(moved_, predicted);
    for (std::size_t i = 0; i < components_.size(); ++i) {
      const Small<N> from = components_[i].belief.mean - before_.mean;
      const Small<N> to = moved_[i].belief.mean - predicted.mean;
      sum += (moved_[i].weight * from) * to.transpose();
    }
    cross = sum;
    std::swap(components_, moved_);
  }

  /// Corrects by a reading; missing rows as `whole` has them. False, and the components as they
  /// were, when no hypothesis of any component explains it.
  bool correct(SizedModel<N, L>& model, const Observation<N, L>& whole,
               AttackHypotheses<N, L>& hypotheses, const Small<L>& y, double& log_density,
               Belief<N>& posterior) {
    candidates_.clear();
    double largest = -kInfinity;
    for (const Component& component : components_) {
      observation_.expect_all();
      model.observe(component.belief, observation_);
      for (Eigen::Index row = 0; row < y.size() && whole.num_missing > 0; ++row) {
        if (whole.is_missing[static_cast<std::size_t>(row)]) observation_.leave_out(row);
      }
      if (!hypotheses.update(component.belief, observation_, model.R(), y, collapsed_).is_usable) {
        continue;
      }
      for (std::size_t h = 0; h < kNumAttackHypotheses; ++h) {
        const auto hypothesis = static_cast<AttackHypothesis>(h);
        const Belief<N>* given = hypotheses.given(hypothesis);
        if (given == nullptr) continue;
        const double weight = std::log(component.weight) + hypotheses.log_weight(hypothesis);
        candidates_.push_back({weight, *given, h});
        largest = std::max(largest, weight);
      }
    }
    if (!(largest > -kInfinity)) return false;
    normalise(largest, log_density);
    num_candidates_ = candidates_.size();
    reduce();
    collapse(components_, posterior);
    return true;
  }

 private:
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();

  struct Component {
    double weight;
    Belief<N> belief;
  };
  struct Candidate {
    double weight;  // a logarithm until normalise()
    Belief<N> belief;
    std::size_t hypothesis;
  };

  void normalise(double largest, double& log_density) {
    double sum = 0.0;
    for (Candidate& candidate : candidates_) {
      candidate.weight = std::exp(candidate.weight - largest);
      sum += candidate.weight;
    }
    probabilities_.fill(0.0);
    for (Candidate& candidate : candidates_) {
      candidate.weight /= sum;
      probabilities_[candidate.hypothesis] += candidate.weight;
    }
    log_density = largest + std::log(sum);
  }

  // The heaviest stay; each other one goes to the nearest of them.
  void reduce() {
    std::stable_sort(candidates_.begin(), candidates_.end(),
                     [](const Candidate& a, const Candidate& b) { return a.weight > b.weight; });
    std::size_t kept = 1;
    while (kept < std::min(components_max_, candidates_.size()) &&
           candidates_[kept].weight >= prune_below_) {
      ++kept;
    }
    components_.resize(kept);
    factors_.resize(kept);
    for (std::size_t i = 0; i < kept; ++i) {
      components_[i] = {candidates_[i].weight, candidates_[i].belief};
      factors_[i].is_definite = factors_[i].factor.factorise(candidates_[i].belief.covariance);
    }
    for (std::size_t c = kept; c < candidates_.size(); ++c) merge(candidates_[c]);
  }

  void merge(const Candidate& candidate) {
    if (candidate.weight == 0.0) return;
    std::size_t nearest = 0;
    double least = kInfinity;
    for (std::size_t i = 0; i < factors_.size() && factors_.size() > 1; ++i) {
      if (!factors_[i].is_definite) continue;
      Small<N> apart = candidate.belief.mean - candidates_[i].belief.mean;
      factors_[i].factor.forward(apart);
      const double distance =
          (apart.array().square() * factors_[i].factor.reciprocals().array()).sum();
      if (distance >= least) continue;
      least = distance;
      nearest = i;
    }
    Component& into = components_[nearest];
    const double weight = into.weight + candidate.weight;
    const double share = candidate.weight / weight;
    const Small<N> apart = candidate.belief.mean - into.belief.mean;
    into.belief.covariance += share * (candidate.belief.covariance - into.belief.covariance);
    into.belief.covariance += (share * (1.0 - share) * apart) * apart.transpose();
    into.belief.mean += share * apart;
    into.weight = weight;
  }

  static void collapse(const std::vector<Component>& components, Belief<N>& whole) {
    const Eigen::Index n = components.front().belief.mean.size();
    whole.mean.setZero(n);
    for (const Component& one : components) whole.mean += one.weight * one.belief.mean;
    whole.covariance.setZero(n, n);
    for (const Component& one : components) {
      const Small<N> apart = one.belief.mean - whole.mean;
      whole.covariance += one.weight * one.belief.covariance;
      whole.covariance += (one.weight * apart) * apart.transpose();
    }
    symmetrise_small(whole.covariance);
  }

  struct Factor {
    SmallFactor<N> factor;
    bool is_definite = false;
  };

  std::size_t components_max_;
  double prune_below_;
  std::vector<Component> components_, moved_;
  std::vector<Candidate> candidates_;
  std::vector<Factor> factors_;
  std::size_t num_candidates_ = 0;
  std::array<double, kNumAttackHypotheses> probabilities_{};
  Observation<N, L> observation_;
  Belief<N> before_, collapsed_;
};

}  // namespace holdfast
