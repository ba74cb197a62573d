#pragma once

#include <array>
#include <vector>

#include "common/measurement_set.h"
#include "estimators/estimate.h"
#include "estimators/hybrid_bernoulli_belief.h"
#include "estimators/hybrid_bernoulli_options.h"

namespace holdfast {

/// Writes the estimate of a hybrid Bernoulli filter; fields as HybridBernoulliFilter says.
class HybridBernoulliOutput {
 public:
  HybridBernoulliOutput(const HybridBernoulliOptions& options, const HybridBernoulliLayout& layout);

  const Estimate& write(std::int64_t step, StepOutcome outcome, const MeasurementSet& measurements,
                        const std::vector<double>& packet_probability,
                        const HybridBernoulliBelief& belief,
                        const std::array<std::size_t, 2>& num_candidates);

 private:
  void write_state(const HybridBernoulliBelief& belief);
  void write_signal(const HybridBernoulliBelief& belief);
  void write_models(const GaussianMixture& p1);

  HybridBernoulliOptions options_;
  HybridBernoulliLayout layout_;
  Estimate estimate_;
  Eigen::VectorXd mean_[2];  // moments of p0 and p1, whole components
  Eigen::MatrixXd covariance_[2];
};

}  // namespace holdfast
