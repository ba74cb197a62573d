#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "common/configuration.h"
#include "common/models/system_model.h"

namespace holdfast {

/// One Gaussian of the prior of the attack signal.
struct AttackTerm {
  double weight = 1.0;         // of the model's terms, > 0; normalised when used
  Eigen::VectorXd mean;        // [channels of the model]
  Eigen::MatrixXd covariance;  // [channels x channels], positive definite
};

/// One way to attack: the channels that it drives, and what it sends, white in time.
struct AttackModel {
  std::string name = "attack";
  double probability = 1.0;   // among the models, > 0; normalised when used
  std::vector<int> channels;  // columns of G and H, ascending; signals of other channels are zero
  std::vector<AttackTerm> terms;
};

/// Beta density of an unknown delivery probability.
struct BetaPrior {
  double alpha = 1.0, beta = 1.0;  // > 0
};

/// Keys of an estimator with `method: hybrid_bernoulli`; YAML keys have the member names.
struct HybridBernoulliOptions {
  enum class Correction { kAuto, kSubstitution, kInjection };
  enum class InputPrior { kGaussian, kFlat, kPaper };
  enum class Feedthrough { kAuto, kDirect, kDelayed };
  enum class Outside { kConstant, kFloor, kZero };
  enum class MergeMetric { kOwn, kDominant };
  enum class Update { kExtended, kUnscented };
  enum class State { kDominant, kMean };

  double birth_probability = 0.05;          // pb
  double survival_probability = 0.95;       // ps
  double delivery_probability = 0.95;       // pd, of each node's authentic packet
  std::optional<BetaPrior> delivery_prior;  // when set, pd is estimated and the number unused;
                                            // YAML: delivery_probability: {alpha: .., beta: ..}
  // Per step, gain of the counts behind the estimated pd; 1: pd is constant in time.
  double delivery_memory = 1.0;
  double substitution_probability = 0.0;  // pf
  // kAuto: substitution for a set of one packet when pf > 0, else injection (paper 000, Remark 4).
  Correction correction = Correction::kAuto;

  // kFlat: density `flat_density` everywhere; kPaper: weights by (85), moments by (101)-(109).
  // Both need rank H = m, or rank C G = m when delayed, and one attack model of all channels.
  InputPrior input_prior = InputPrior::kGaussian;
  double flat_log_density = 0.0;  // log c of kFlat, in 1 / units of a
  // kAuto: direct when H is not zero. Direct: r and a are those of step k; delayed: of step k - 1.
  Feedthrough feedthrough = Feedthrough::kAuto;
  std::vector<AttackModel> attack_models;  // none: one, all channels, N(0, I)
  // Probability that an attack that goes on keeps its model; otherwise the model is drawn anew by
  // the models' probabilities. 0: white in time, as the signal is.
  double attack_model_persistence = 0.0;

  // r, mean and covariance of x before the packets of step 1.
  double start_attack_probability = 0.1;
  Eigen::VectorXd start_mean;        // [n]; empty: zero
  Eigen::MatrixXd start_covariance;  // [n x n]; empty: identity

  // Density of a false packet: uniform on the box; a packet of some rows has the rows' sides.
  Eigen::VectorXd packet_box_low, packet_box_high;  // [l]; empty: -10 and 10
  // Of a packet outside the box: kConstant as inside; kFloor times outside_floor; kZero none, so
  // that it is authentic for certain (the limit kappa -> 0).
  Outside outside = Outside::kConstant;
  double outside_floor = 1e-6;

  double prune_below = 1e-3;  // gamma_p: a component of this weight or less is dropped
  double merge_below = 3.0;   // gamma_m, a squared distance; 0: no merging
  // Covariance of the distance: the candidate's own (Vo and Ma 2006) or the dominant one's.
  MergeMetric merge_metric = MergeMetric::kOwn;
  int components_max = 100;           // of each of p0 and p1, after merging
  Update update = Update::kExtended;  // of a nonlinear model
  State state = State::kDominant;     // what Estimate::mean is; see HybridBernoulliFilter

  /// Reads the keys and reports values that do not fit the model. YAML: `start` holds
  /// attack_probability, mean, covariance or std; `packet_box` holds low, high, outside, floor.
  void read(ConfigurationMap& map, const SystemModel& model);
  /// What is wrong for this model; empty when all is well.
  std::vector<std::string> problems(const SystemModel& model) const;
  /// The same with every default filled in (attack models, start, box).
  HybridBernoulliOptions completed(const SystemModel& model) const;
};

}  // namespace holdfast
