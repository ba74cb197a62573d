#pragma once

#include <memory>
#include <vector>

#include "estimators/attack_assumptions.h"
#include "estimators/attacked_reading.h"
#include "estimators/vector_filter.h"

namespace holdfast {

/// Keys of `method: gslr`.
struct GslrOptions : VectorFilterOptions {
  AttackAssumptions assumes;
  RegressionMoments moments = RegressionMoments::kExact;
  bool skip_zero = false;  // a vector of exact zeros is DoS; the regression then leaves DoS out

  void read(ConfigurationMap& map, const SystemModel& model);
};

/// Kalman filter on the statistical linear regression of the attacked reading, paper 001 (Algorithm
/// 1 and the filter of Algorithm 2), with its moments as printed or corrected (docs/gslr.md).
///
/// One Gaussian stands for reading and attack together, so it has no opinion of whether a step is
/// attacked: attack_probability stays -1. What cannot show the state (every reading forced to zero)
/// skips the update.
class Gslr : public VectorFilter {
 public:
  /// rows[s]: rows of y that a packet of source s carries. Throws UsageError when model, options
  /// and rows do not fit.
  Gslr(const SystemModel& model, const GslrOptions& options, std::vector<std::vector<int>> rows);
};

/// The same beliefs once it is known that a reading was not forced to zero: alpha_c = 1,
/// alpha_b' = alpha_b / (1 - (1 - alpha_b)(1 - alpha_c)).
AttackStatistics given_no_dos(AttackStatistics statistics);

/// The arithmetic of that filter alone. Throws UsageError when model and options do not fit.
std::unique_ptr<VectorKernel> make_kernel(const SystemModel& model, const GslrOptions& options);

}  // namespace holdfast
