#pragma once

#include <memory>
#include <vector>

#include "estimators/attack_assumptions.h"
#include "estimators/attack_fit.h"
#include "estimators/vector_filter.h"

namespace holdfast {

/// Keys of `method: attack_mixture`.
struct AttackMixtureOptions : VectorFilterOptions {
  AttackAssumptions assumes;
  double zero_std = 0.0;    // of what a sensor forced to zero shows; 0: exact zeros, which prove it
  int smoother_passes = 3;  // of expectation propagation; 1: Rauch-Tung-Striebel only
  int components_max = 1;   // Gaussians that it keeps from step to step; 1: GPB1
  double prune_below = 1e-4;  // of more: lighter ones are merged into the nearest
  // Steps over which it learns what it assumes, from that as a first guess; 0: not at all.
  double learn_over_steps = 0.0;

  void read(ConfigurationMap& map, const SystemModel& model);
};

/// What an AttackMixture believes of attacks, and what it has seen of them.
struct AttackLearning {
  AttackStatistics statistics;
  AttackFit fit;
  bool sums_up = false;  // costs a step's time, so only where somebody asks
};

/// A filter that asks of each reading what was done to it: nothing, bias, scale, both, or forced to
/// zero. One Kalman update per hypothesis, collapsed to one Gaussian (GPB1; docs/gslr.md) or to
/// several (AttackSum; its smoother is Rauch-Tung-Striebel, and hypotheses have the common state).
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

  /// What it believes now; moves when it learns.
  const AttackStatistics& statistics() const { return learning_->statistics; }
  /// Sums up readings from now on, for fit().
  void prepare_fit() { learning_->sums_up = true; }
  /// One step of expectation-maximisation from these beliefs: what the readings since prepare_fit()
  /// say of the attacks. After smooth() of a linear model with several passes by all readings that
  /// it remembers, else each reading in the light of the earlier ones. Precondition: does not
  /// learn.
  AttackStatistics fit() const {
    AttackStatistics fitted = learning_->statistics;
    learning_->fit.maximise(fitted);
    return fitted;
  }
  /// Its beliefs change with time (`assumes.changes`), so that no one block can say them.
  bool believes_in_changes() const { return options_.assumes.periods.size() > 1; }
  /// The same filter before its first step, with other beliefs, which stay: it does not learn.
  std::unique_ptr<AttackMixture> renewed(const AttackStatistics& statistics) const;
  /// That with one Gaussian, prepared for fit().
  std::unique_ptr<AttackMixture> renewed_for_fit(const AttackStatistics& statistics) const;

 private:
  AttackMixture(const SystemModel& model, const AttackMixtureOptions& options,
                std::vector<std::vector<int>> rows, std::shared_ptr<AttackLearning> learning);

  SystemModel model_;
  AttackMixtureOptions options_;
  std::vector<std::vector<int>> rows_;
  std::shared_ptr<AttackLearning> learning_;  // the kernel sums up
};

/// The arithmetic of that filter alone. Throws UsageError when model and options do not fit.
std::unique_ptr<VectorKernel> make_kernel(const SystemModel& model,
                                          const AttackMixtureOptions& options);

}  // namespace holdfast
