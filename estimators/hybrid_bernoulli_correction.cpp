#include "estimators/hybrid_bernoulli_correction.h"

#include <array>
#include <cmath>

#include "estimators/gaussian_mixture.h"
#include "estimators/mixture_reduction.h"

namespace holdfast {

HybridBernoulliCorrection::HybridBernoulliCorrection(const SystemModel& model,
                                                     const HybridBernoulliOptions& options,
                                                     const HybridBernoulliLayout& layout,
                                                     const std::vector<std::vector<int>>& rows)
    : options_(options),
      correction0_(model, options, layout, rows, false),
      correction1_(model, options, layout, rows, true) {}

StepOutcome HybridBernoulliCorrection::correct(const HybridBernoulliBelief& belief,
                                               const PacketNode& node,
                                               HybridBernoulliBelief& corrected,
                                               std::span<double> packet_probability,
                                               PacketHistory* history) {
  make_rule(node);
  const double log_n0 = correction0_.weigh(belief.p0, node, rule_);
  const double log_n1 = correction1_.weigh(belief.p1, node, rule_);
  const std::array<double, 2> joint = {belief.log_not_r + log_n0, belief.log_r + log_n1};
  const double log_sum = log_sum_exp(joint);
  if (!std::isfinite(log_sum)) {
    corrected = belief;
    return StepOutcome::kDegenerateWeights;
  }
  corrected.log_not_r = joint[0] - log_sum;
  corrected.log_r = joint[1] - log_sum;
  if (history == nullptr) judge(belief, log_sum, node, packet_probability);
  build(correction0_, log_n0, belief.p0, corrected.p0, history);
  build(correction1_, log_n1, belief.p1, corrected.p1, history);
  const bool has_failed = correction0_.num_failures() + correction1_.num_failures() > 0;
  return has_failed ? StepOutcome::kFactorisationFailed : StepOutcome::kOk;
}

void HybridBernoulliCorrection::judge(const HybridBernoulliBelief& belief, double log_sum,
                                      const PacketNode& node,
                                      std::span<double> packet_probability) {
  shares_.assign(static_cast<std::size_t>(node.count()), 0.0);
  correction0_.add_shares(belief.log_not_r - log_sum, shares_);
  correction1_.add_shares(belief.log_r - log_sum, shares_);
  std::size_t c = 0;
  for (const SourcePackets& packets : node.sources) {
    for (const int position : packets.position) {
      packet_probability[static_cast<std::size_t>(position)] = std::min(shares_[c++], 1.0);
    }
  }
}

// The density of a hypothesis that became impossible stays: it may come back.
void HybridBernoulliCorrection::build(MixtureCorrection& correction, double log_sum,
                                      const GaussianMixture& before, GaussianMixture& after,
                                      PacketHistory* history) {
  if (!std::isfinite(log_sum)) {
    after = before;
    return;
  }
  prune(correction.log_weights(), std::log(options_.prune_below) + log_sum, kChildrenMax, kept_);
  correction.build(kept_, log_sum, after);
  if (history != nullptr) correction.record(kept_, log_sum, after, *history);
  after.normalise();
}

void HybridBernoulliCorrection::make_rule(const PacketNode& node) {
  using Correction = HybridBernoulliOptions::Correction;
  const int count = node.count();
  // An estimated probability is each component's own and added there.
  const bool is_known = !options_.delivery_prior.has_value();
  const double pd = options_.delivery_probability, pf = options_.substitution_probability;
  const bool is_substitution =
      count == 1 && (options_.correction == Correction::kSubstitution ||
                     (options_.correction == Correction::kAuto && pf > 0.0));
  rule_.authentic.clear();
  rule_.none_is_delivered = is_substitution;
  rule_.none = 0.0;
  if (count == 0 || make_certain_rule(node)) return;
  if (is_substitution) {
    rule_.authentic.push_back(std::log1p(-pf));
  } else {
    rule_.none = is_known ? std::log1p(-pd) : 0.0;
  }
  const double log_delivered = (is_known ? std::log(pd) : 0.0) - std::log(count);
  for (const SourcePackets& packets : node.sources) {
    for (const double log_kappa : packets.log_false_density) {
      if (is_substitution) {
        rule_.none = std::log(pf) + log_kappa;
      } else {
        rule_.authentic.push_back(log_delivered - log_kappa);
      }
    }
  }
}

// The limit kappa -> 0 of either form: terms without 1 / kappa vanish.
bool HybridBernoulliCorrection::make_certain_rule(const PacketNode& node) {
  bool is_certain = false;
  for (const SourcePackets& packets : node.sources) {
    for (const double log_kappa : packets.log_false_density) {
      is_certain = is_certain || !std::isfinite(log_kappa);
    }
  }
  if (!is_certain) return false;
  rule_.none = kImpossible;
  for (const SourcePackets& packets : node.sources) {
    for (const double log_kappa : packets.log_false_density) {
      rule_.authentic.push_back(std::isfinite(log_kappa) ? kImpossible : 0.0);
    }
  }
  return true;
}

}  // namespace holdfast
