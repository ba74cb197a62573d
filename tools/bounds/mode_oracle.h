#pragma once

#include <vector>

#include "estimators/estimator.h"
#include "estimators/multiple_model.h"
#include "tools/bounds/told_estimator.h"

namespace holdfast {

/// Keys of `method: mode_oracle`.
struct ModeOracleOptions {
  GaussianOptions start;
  InputStateRule filter;
  VectorOptions vector;

  void read(ConfigurationMap& map, const ModeSet& modes);
};

/// The filter of state and unknown inputs that is told the mode of each step, but not the inputs:
/// the bound for every filter that has to find the mode out.
class ModeOracle : public Estimator, public ToldEstimator {
 public:
  /// Throws UsageError when modes, options and rows do not fit, or no filter exists in a mode.
  ModeOracle(const ModeSet& modes, const ModeOracleOptions& options,
             std::vector<std::vector<int>> rows);

  void tell(const ToldTruth& truth) override;
  const Estimate& step(std::int64_t step, const MeasurementSet& measurements,
                       const Eigen::VectorXd& known_input) override;

 private:
  VectorOfRows vector_;
  InputStateFilter filter_;
  InputStatePublisher publisher_;
  int mode_ = 0, previous_mode_ = 0;
  Estimate estimate_;
};

}  // namespace holdfast
