#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "common/measurement_set.h"
#include "common/models/binary_target/binary_target_model.h"
#include "estimators/detection_table.h"
#include "estimators/particle_kernel.h"
#include "estimators/particle_set.h"

namespace holdfast {

/// What a filter makes of several packets of one sensor in one step.
enum class DuplicateRule {
  kAverage,  // one of them, equally likely each, is the sensor's: average of their likelihoods
  kProduct,  // independent readings: product of their likelihoods
  kFirst,    // in order of arrival; the others are ignored
  kLast
};

/// Likelihood of a step's packets for every particle, eqs. (13)-(16) of paper 002 in affine form:
///
///   p(y_s | x) = (1 - P1) p0(y) + P1 p1(y),  P1 = c0 + (c1 - c0) q_s(x),  q_s(x) = P(h_s(x) + nu >
///   T),
///
/// with c0, c1 the probabilities that the bit arrives as 1 without and with a detection, given the
/// assumed attack; p0, p1 = N(y; 0, s^2), N(y; tau, s^2) on the radio channel, and 1{y = 0},
/// 1{y = 1} on a digital bus. Hence p = at_miss (1 - q) + at_hit q with two numbers per packet.
/// A threshold below zero is exceeded by the zero that a DoS attack leaves.
class BinaryLikelihood {
 public:
  /// Empty vectors in `assumed` stand for zeros. Throws UsageError for a table that cannot be
  /// built.
  BinaryLikelihood(const BinaryTargetModel& model, const BinaryTargetModel::Attack& assumed,
                   DuplicateRule duplicates, bool uses_table, const ParticleKernel& kernel);

  struct Reception {
    std::size_t num_used = 0;     // packets that were taken in
    std::size_t num_refused = 0;  // unknown source, not one value, not finite, or no bit
  };
  /// Takes in Z_k. Afterwards the calls below are about this set, until the next one.
  Reception set_measurements(const MeasurementSet& measurements);

  std::size_t num_factors() const { return factors_.size(); }
  /// True when the bare product neither underflows nor loses digits.
  bool is_linear() const { return num_linear_ == factors_.size(); }

  /// Product of the factors, up to exp(log_constant()); out: [padded]. Precondition: is_linear().
  /// q: [num_factors x padded] receives the detection probabilities, unless null.
  void likelihood(const ParticleSet& particles, double* out, double* q) const;
  /// Its logarithm, up to log_constant(); below -1e250 for a particle that is impossible.
  void log_likelihood(const ParticleSet& particles, double* out, double* q) const;
  /// Sum over factors of the logarithm that was divided out, so that the sum is log p(Z_k | x).
  double log_constant() const { return log_constant_; }

  /// P(packet authentic | Z_k), a packet being authentic when neither DoS nor deception touched its
  /// reading and no flip its bit:
  ///
  ///   sum_i w_i (1-phi)(1-varphi)(1-alpha) [q p1(y) + (1-q) p0(y)] / sum over j of p(y_j | x_i)
  ///
  /// where j runs over the packets of the sensor under kAverage (one of them is the sensor's) and
  /// is the packet itself otherwise. 0 for a packet that was refused or ignored.
  /// weights: posterior, normalised, zero in the padding; q: as filled above.
  double authentic_probability(std::size_t packet, const double* weights, const double* q,
                               std::size_t padded) const;

 private:
  // c0, c1 and their complements, each computed without cancellation, and P(not attacked).
  struct Sensor {
    double log_one_at_miss, log_zero_at_miss, log_one_at_hit, log_zero_at_hit, log_authentic;
  };
  struct Term {  // log of at_hit and at_miss, up to `constant`; of the numerator likewise
    double hit = 0.0, miss = 0.0, constant = 0.0;
    double authentic_hit = 0.0, authentic_miss = 0.0;
    double count = 1.0;
  };
  struct PacketTerm {
    Term term;
    std::int32_t group = -1;
  };

  bool make_term(const Sensor& sensor, double value, Term& term) const;
  std::int32_t add_to_group(std::size_t sensor, const Term& term);
  void make_factors();
  LikelihoodProblem problem(bool as_log, double* q) const;

  BinaryTargetModel model_;
  DuplicateRule duplicates_;
  const ParticleKernel& kernel_;
  DetectionLaw law_;
  std::unique_ptr<DetectionTable> table_;
  double linear_min_;
  std::vector<Sensor> sensors_;
  std::vector<std::int32_t> group_of_sensor_;

  std::vector<Term> groups_;  // one per factor, in order of first arrival
  std::vector<std::size_t> sensor_of_group_;
  std::vector<std::int32_t> row_of_group_;
  std::vector<PacketTerm> packets_;
  std::vector<LikelihoodFactor> factors_;  // linear ones first, then log, then two-log
  std::size_t num_linear_ = 0, num_log_ = 0;
  double log_constant_ = 0.0;
};

}  // namespace holdfast
