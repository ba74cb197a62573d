#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "estimators/baseline_options.h"
#include "estimators/estimator.h"
#include "estimators/kalman_core.h"
#include "estimators/packet_association.h"
#include "estimators/packet_choice.h"
#include "estimators/packet_inbox.h"

namespace holdfast {

/// Interacting multiple model filter with two modes, no attack and attack: one Gaussian for each,
/// where the hybrid Bernoulli filter has a mixture for each.
///
/// The mode is a Markov chain: P(attack | no attack before) = pb, P(attack | attack before) = ps.
/// Each step both modes predict x; the predictions are mixed by the probabilities of where each
/// mode comes from, moments matched; the attack mode is joined with a fresh input. (Mixed after the
/// prediction, since what the attack did to x is known to the attack mode only.) Then
///
///   P(mode | Z_k) ~ P(mode) p(Z_k | mode)
///
/// where p is N(nu; 0, S) of one vector by PacketChoice, or N of PacketAssociation over all
/// packets, source after source. A step without packets changes no probability but by the chain. A
/// gate that leaves out every packet does the same.
///
/// mode_probability: {no attack, attack}; attack_probability the latter. mean, covariance: of both
/// modes together; each mode's in `hypotheses`. input_mean: of the attack mode.
class InteractingMultipleModel : public Estimator {
 public:
  /// Throws UsageError when model, options and rows do not fit.
  InteractingMultipleModel(const SystemModel& model, const InteractingMultipleModelOptions& options,
                           std::vector<std::vector<int>> rows);

  const Estimate& step(std::int64_t step, const MeasurementSet& measurements,
                       const Eigen::VectorXd& known_input) override;

  /// Packets refused since construction.
  std::int64_t refused_packets() const { return inbox_.refused_packets(); }

 private:
  void predict();
  void correct_by_choice();
  void correct_by_all();
  void reweigh(double log_likelihood_none, double log_likelihood_attack);
  void publish(std::int64_t step);

  double log_birth_, log_no_birth_, log_survival_, log_death_;
  KalmanCore none_core_, attack_core_;
  PacketInbox inbox_;
  PacketChoice choice_;
  std::vector<PacketAssociation> associations_;  // of both modes; none when a vector is chosen
  Gaussian none_, attack_;                       // beliefs on x and on z
  Gaussian from_none_, from_attack_, mixed_;     // on x
  double log_none_, log_attack_;                 // log probabilities of the modes
  bool has_started_ = false;
  Estimate estimate_;
};

}  // namespace holdfast
