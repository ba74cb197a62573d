#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "common/models/system_model.h"
#include "estimators/estimator.h"
#include "estimators/hybrid_bernoulli_belief.h"
#include "estimators/hybrid_bernoulli_options.h"

namespace holdfast {

/// Gaussian-mixture hybrid Bernoulli filter (papers 000 and 003): is there an attack, which packet
/// is authentic, what are the state and the attack signal.
///
/// A step predicts (000 (78)-(83), (110)-(143); not at step 1), corrects by the packets
/// (000 (35)-(37), (44)-(53) and 003 (23)-(30), with the errata of docs), reduces, estimates.
///
/// Packets. rows[s] lists the rows of y that a packet of source s carries. Sources whose rows
/// overlap, directly or in a chain, form one *node*; a node sends one authentic packet per step,
/// of any of its sources, delivered with probability pd, and every other packet is false. Nodes
/// are independent given the state: R has no correlation between them. They are corrected one
/// after the other, in the order of their first source, and merging follows the last; a node
/// without packets changes nothing (when pd is estimated it counts as a loss). A packet of an
/// unknown source, of the wrong size or with a value that is not finite is refused and counted.
///
/// Estimate: mean and covariance by options.state: kDominant, those of the heaviest component of p1
/// when r > 0.5, else of p0 (the papers' estimate); kMean, of the whole mixture over both.
/// attack_probability r; input_* the signal part of the heaviest component of p1, for step k when
/// direct, for k - 1 when delayed or with a memory (HybridBernoulliLayout); hypotheses "no_attack"
/// and "attack": moments of p0 and p1; mode_probability (several attack models): of each model,
/// given an attack; packet_probability: posterior of being authentic given all packets up to this
/// step, in the order of the set, 0 for one refused. Numbers of Gaussians stand with the
/// hypotheses.
class HybridBernoulliFilter : public Estimator {
 public:
  /// Throws UsageError when options or rows do not fit the model.
  HybridBernoulliFilter(const SystemModel& model, const HybridBernoulliOptions& options,
                        std::vector<std::vector<int>> rows);
  ~HybridBernoulliFilter() override;

  /// The known input is not used.
  const Estimate& step(std::int64_t step, const MeasurementSet& measurements,
                       const Eigen::VectorXd& known_input) override;

  /// After step(): the corrected and reduced belief. Before: that before the packets of step 1.
  const HybridBernoulliBelief& belief() const;
  double log_odds() const { return belief().log_odds(); }
  double attack_probability() const { return belief().attack_probability(); }
  const GaussianMixture& p0() const { return belief().p0; }
  const GaussianMixture& p1() const { return belief().p1; }
  const HybridBernoulliLayout& layout() const;
  /// Replaces the belief; as_predicted: the next step corrects it without predicting first.
  void set_belief(const HybridBernoulliBelief& belief, bool as_predicted);

  /// Mean of the delivery probability; the option's when it is known.
  double delivery_probability() const;
  /// Components of p0 and p1 together after the last step, and candidates before pruning.
  int num_components() const { return p0().size() + p1().size(); }
  std::int64_t num_candidates() const;
  /// Packets refused since construction.
  std::int64_t refused_packets() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace holdfast
