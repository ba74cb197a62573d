#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "common/configuration.h"

namespace holdfast {

/// What is believed of attacks on a reading z, eq. (4) of paper 001:
///
///   y = xb z + (1 - xb) xc (1 + xm (m - 1)) (z + xa a),  a ~ N(mu_a, Sigma_a),  m ~ N(mu_m, s_m^2)
///
/// xb, xc, xm, xa: independent Bernoulli variables with the means alpha_b, alpha_c, alpha_m,
/// alpha_a, white in time, one draw of each and of the scalar m per step for the whole vector.
struct AttackStatistics {
  double attack_probability = 0.3;  // 1 - alpha_b
  double dos_probability = 0.1;     // 1 - alpha_c: of an attack forcing all of y to zero
  double bias_probability = 0.3;    // alpha_a, of an attack that does not
  double scale_probability = 0.1;   // alpha_m, of an attack that does not
  Eigen::VectorXd bias_mean;        // mu_a [l]
  Eigen::MatrixXd bias_covariance;  // Sigma_a [l x l]
  double scale_mean = 1.0;          // mu_m
  double scale_std = 0.0;           // s_m

  /// A bias of l zeros.
  static AttackStatistics of_size(int num_measurements);
  /// True when a and m have the right sizes and all numbers are in their ranges.
  bool is_valid(int num_measurements) const;
};

/// Moments of the factors of z and a in the attacked reading, spec of the method, section 2:
/// y = S z + C xa a with S = xb + C, C = (1 - xb) xc (1 + xm (m - 1)).
struct ScaleMoments {
  double c1 = 0.0, c2 = 0.0;  // E[C], E[C^2]
  double s1 = 1.0, s2 = 1.0;  // E[S], E[S^2]
  double spread = 0.0;        // s2 - s1^2

  explicit ScaleMoments(const AttackStatistics& statistics);
};

/// What may have been done to one reading.
enum class AttackHypothesis { kUntouched = 0, kBiased, kScaled, kBoth, kForcedToZero };

inline constexpr std::size_t kNumAttackHypotheses = 5;
/// Names as published: untouched, biased, scaled, both, forced_to_zero.
const std::array<std::string, kNumAttackHypotheses>& attack_hypothesis_names();
/// Prior probability of each, summing to one.
std::array<double, kNumAttackHypotheses> attack_hypothesis_probabilities(
    const AttackStatistics& statistics);

}  // namespace holdfast
