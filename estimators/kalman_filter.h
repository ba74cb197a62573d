#pragma once

#include <memory>
#include <vector>

#include "estimators/vector_filter.h"

namespace holdfast {

/// Kalman filter that knows of no attack: the standard to compare with. Extended, unscented or
/// cubature for a nonlinear model; with a chi-square gate or blind to exact zeros on request.
///
/// Each step predicts (not the first, unless the start is x_0) and is corrected by one vector of
/// Z_k. attack_probability is the score P(chi-square with the vector's rows <= nu' S^-1 nu), of the
/// nearest packet when the gate left out all; without packets the last score stands.
class KalmanFilter : public VectorFilter {
 public:
  /// rows[s]: rows of y that a packet of source s carries. Throws UsageError when model, options
  /// and rows do not fit.
  KalmanFilter(const SystemModel& model, const KalmanFilterOptions& options,
               std::vector<std::vector<int>> rows);

 private:
  void judge(const Finding& finding, Estimate& estimate) override;

  double score_ = 0.0;
};

/// The arithmetic of that filter alone. Throws UsageError when model and options do not fit.
std::unique_ptr<VectorKernel> make_kernel(const SystemModel& model,
                                          const KalmanFilterOptions& options);

}  // namespace holdfast
