#pragma once

#include "estimators/gaussian_mixture.h"

namespace holdfast {

/// What a hybrid Bernoulli filter believes: the triplet (r, p0, p1) of paper 000.
///
/// r is the probability of an attack, p0 the density of the state without and p1 that of the state
/// and the signal with an attack. Weights of p0 and of p1 sum to one each.
struct HybridBernoulliBelief {
  double log_r = 0.0, log_not_r = 0.0;  // log r and log (1 - r)
  GaussianMixture p0, p1;

  double log_odds() const { return log_r - log_not_r; }
  double attack_probability() const;
  void set_attack_probability(double r);
  /// r from its log odds, without loss at either end.
  void set_log_odds(double log_odds);
};

/// Where things stand in a component.
///
/// p0: x_k; p1: [x_k; a_k], or [x_k; a_{k-1}] when delayed. With a memory, which a feedthrough H
/// of rank below m asks for, both end with a_{k-1} (zero, for certain, when there was no attack).
struct HybridBernoulliLayout {
  int num_states = 0, num_channels = 0;
  bool is_delayed = false;
  bool has_memory = false;

  int dimension0() const { return num_states + (has_memory ? num_channels : 0); }
  int dimension1() const { return dimension0() + num_channels; }
};

}  // namespace holdfast
