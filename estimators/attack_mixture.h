#pragma once

#include <memory>
#include <vector>

#include "estimators/attack_assumptions.h"
#include "estimators/vector_filter.h"

namespace holdfast {

/// Keys of `method: attack_mixture`.
struct AttackMixtureOptions : VectorFilterOptions {
  AttackAssumptions assumes;
  double zero_std = 0.0;    // of what a sensor forced to zero shows; 0: exact zeros, which prove it
  int smoother_passes = 3;  // of expectation propagation; 1: Rauch-Tung-Striebel only

  void read(ConfigurationMap& map, const SystemModel& model);
};

/// A filter that asks of each reading what was done to it: nothing, bias, scale, both, or forced to
/// zero. One Kalman update per hypothesis, collapsed to one Gaussian (GPB1; docs/gslr.md).
///
/// attack_probability is 1 - P(untouched | readings up to now); hypotheses hold the posterior
/// probability of each and the state given it. Without packets the prior probabilities stand. The
/// innovation is that of the most probable hypothesis; none where that is forced to zero.
class AttackMixture : public VectorFilter {
 public:
  /// rows[s]: rows of y that a packet of source s carries. Throws UsageError when model, options
  /// and rows do not fit.
  AttackMixture(const SystemModel& model, const AttackMixtureOptions& options,
                std::vector<std::vector<int>> rows);
};

/// The arithmetic of that filter alone. Throws UsageError when model and options do not fit.
std::unique_ptr<VectorKernel> make_kernel(const SystemModel& model,
                                          const AttackMixtureOptions& options);

}  // namespace holdfast
