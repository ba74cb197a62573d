#pragma once

#include <array>
#include <span>
#include <vector>

#include "estimators/estimate.h"
#include "estimators/hybrid_bernoulli_belief.h"
#include "estimators/mixture_correction.h"
#include "estimators/packet_history.h"

namespace holdfast {

/// Corrects (r, p0, p1) by the packets of one node, eqs. (35)-(37) and (44)-(53) of paper 000 and
/// (23)-(27) of 003.
///
/// Likelihoods of n packets, Psi_i(y) the density of an authentic packet, kappa of a false one:
///   injection     N_i = 1 - pd + pd / n sum over y of Psi_i(y) / kappa(y)
///   substitution  N_i = (1 - pf) Psi_i(y) + pf kappa(y)                     (n = 1)
///   r' = r N_1 / ((1 - r) N_0 + r N_1)
/// No packet: nothing changes; when pd is estimated, one more loss is counted. Several packets are
/// always treated as an injection (000, Remark 4). Where kappa is zero for some packets one of
/// these is authentic. Children of posterior weight at most prune_below, within p0 or p1, are not
/// made, nor are more than kChildrenMax.
class HybridBernoulliCorrection {
 public:
  static constexpr int kChildrenMax = 2048;

  HybridBernoulliCorrection(const SystemModel& model, const HybridBernoulliOptions& options,
                            const HybridBernoulliLayout& layout,
                            const std::vector<std::vector<int>>& rows);

  /// corrected is overwritten; it has the layout's mixtures and is another object. Posterior of
  /// each packet being authentic goes to packet_probability[position]; with a history, which other
  /// nodes share, to it instead. kDegenerateWeights: no hypothesis explains the packets, corrected
  /// is the belief; kFactorisationFailed: components were lost.
  StepOutcome correct(const HybridBernoulliBelief& belief, const PacketNode& node,
                      HybridBernoulliBelief& corrected, std::span<double> packet_probability,
                      PacketHistory* history = nullptr);
  /// Children of p0 and of p1 weighed in the last correct().
  std::array<std::size_t, 2> num_candidates() const {
    return {correction0_.log_weights().size(), correction1_.log_weights().size()};
  }

 private:
  void judge(const HybridBernoulliBelief& belief, double log_sum, const PacketNode& node,
             std::span<double> packet_probability);
  void make_rule(const PacketNode& node);
  bool make_certain_rule(const PacketNode& node);
  void build(MixtureCorrection& correction, double log_sum, const GaussianMixture& before,
             GaussianMixture& after, PacketHistory* history);

  HybridBernoulliOptions options_;
  MixtureCorrection correction0_, correction1_;
  CorrectionRule rule_;
  std::vector<double> shares_;
  std::vector<int> kept_;
};

}  // namespace holdfast
