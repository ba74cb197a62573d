#pragma once

#include <vector>

#include "estimators/component_motion.h"
#include "estimators/hybrid_bernoulli_belief.h"
#include "estimators/hybrid_bernoulli_options.h"

namespace holdfast {

/// Moves (r, p0, p1) to the next step, eqs. (50)-(53) and (78)-(83) of paper 000; without direct
/// feedthrough (63)-(64), whose mixture the paper leaves out.
///
///   r+  = (1 - r) pb + r ps
///   p0+ = {(1-r)(1-pb)/(1-r+) w_0j, f_0j} u {r (1-ps)/(1-r+) w_1j, f_1j}
///   p1+ = {(1-r) pb/r+ w_0j w_h, f_0j} u {r ps/r+ w_1j w_h, f_1j}, each joined with term h
///
/// f_ij moves component j of p_i. Direct: a+ of term h is independent of x+; delayed: p1+ holds
/// [f(x, a_h); a_h] and f_1j drops the signal that has acted. Order of components: of p0 first,
/// then of p1, the attack models' terms in order for each. O(J T d^3), once per shared covariance
/// when the model is linear; T terms.
class HybridBernoulliPrediction {
 public:
  /// The options must be complete.
  HybridBernoulliPrediction(const SystemModel& model, const HybridBernoulliOptions& options,
                            const HybridBernoulliLayout& layout);

  /// predicted is overwritten; it has the layout's mixtures and is another object.
  void predict(const HybridBernoulliBelief& belief, HybridBernoulliBelief& predicted);
  /// p1 for a density of x that knows nothing of the signal: every component joined with every
  /// term, x and a independent. For the start.
  void join_independently(const GaussianMixture& p0, GaussianMixture& p1);

 private:
  struct Term {
    int attack_model = 0;
    double log_weight = 0.0;               // in its model
    std::vector<double> mean, covariance;  // of all channels, zero where it leaves one alone
  };

  void predict_odds(const HybridBernoulliBelief& belief, HybridBernoulliBelief& predicted);
  void move_mixture(const GaussianMixture& parent, bool is_attacked, GaussianMixture& p0,
                    GaussianMixture& p1);
  void add_terms(const GaussianMixture& parent, int component, bool is_attacked, int moved,
                 std::size_t slot, GaussianMixture& p0, GaussianMixture& p1);
  void join(const double* mean, const double* covariance, int width, std::size_t term,
            double log_weight, const ComponentTag& tag, int& shared, GaussianMixture& p1);
  void drive(const GaussianMixture& parent, int component, std::size_t term, double log_weight,
             const ComponentTag& tag, int& shared, GaussianMixture& p1);
  double log_model_probability(int before, int after) const;

  HybridBernoulliLayout layout_;
  HybridBernoulliOptions options_;
  ComponentMotion motion_;
  std::vector<Term> terms_;
  std::vector<double> model_probability_;
  // Logarithms of the factors above: log_to_[i][j] of a component of p_i in p_j+.
  double log_to_[2][2] = {};
  std::vector<double> mean_, covariance_, joint_mean_, joint_covariance_;
  // Per covariance of the parent, and per term: its place in the predicted mixture, -1: none yet.
  std::vector<int> in_p0_, in_p1_;
};

}  // namespace holdfast
