#include "estimators/hybrid_bernoulli_belief.h"

#include <cmath>
#include <limits>

namespace holdfast {

double HybridBernoulliBelief::attack_probability() const {
  return std::exp(log_r);
}

void HybridBernoulliBelief::set_attack_probability(double r) {
  log_r = std::log(r);
  log_not_r = std::log1p(-r);
}

void HybridBernoulliBelief::set_log_odds(double log_odds) {
  // log(1 / (1 + e^-x)) without overflow, from the side whose exponential is small.
  const auto log_sigmoid = [](double x) {
    return x >= 0.0 ? -std::log1p(std::exp(-x)) : x - std::log1p(std::exp(x));
  };
  log_r = log_sigmoid(log_odds);
  log_not_r = log_sigmoid(-log_odds);
}

}  // namespace holdfast
