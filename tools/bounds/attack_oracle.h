#pragma once

#include <memory>
#include <vector>

#include "estimators/attack_assumptions.h"
#include "estimators/vector_filter.h"
#include "tools/bounds/told_estimator.h"

namespace holdfast {

/// Keys of `method: attack_oracle`.
struct AttackOracleOptions : VectorFilterOptions {
  AttackAssumptions assumes;  // of bias and scale; probabilities are not needed

  void read(ConfigurationMap& map, const SystemModel& model);
};

/// The Kalman filter that is told what was done to each step's readings, but not by how much: the
/// floor for every filter that has to find that out. A forced reading teaches nothing.
///
/// Precondition: an attack on a step is one on all of its readings.
class AttackOracle : public VectorFilter, public ToldEstimator {
 public:
  /// Throws UsageError when model, options and rows do not fit.
  AttackOracle(const SystemModel& model, const AttackOracleOptions& options,
               std::vector<std::vector<int>> rows);

  void tell(const ToldTruth& truth) override { *truth_ = truth.frames; }

 private:
  using SharedTruth = std::shared_ptr<AttackHypothesis>;

  AttackOracle(const SystemModel& model, const AttackOracleOptions& options,
               std::vector<std::vector<int>> rows, SharedTruth truth);
  void judge(const Finding& finding, Estimate& estimate) override;

  SharedTruth truth_;  // the kernel reads it
};

}  // namespace holdfast
