#pragma once

#include <vector>

#include "estimators/baseline_options.h"
#include "estimators/estimator.h"
#include "estimators/kalman_core.h"
#include "estimators/vector_correction.h"

namespace holdfast {

/// Extended Kalman filter that knows of no attack: the standard to compare with.
///
/// x_1 ~ start before Z_1. Each step predicts (not the first) and is corrected by one vector of
/// Z_k, chosen by PacketChoice; rows without a packet leave C and R. attack_probability is the
/// score P(chi-square with the vector's rows <= nu' S^-1 nu), of the nearest packet when the gate
/// left out all; without packets the last score stands.
class KalmanFilter : public Estimator {
 public:
  /// rows[s]: rows of y that a packet of source s carries. Throws UsageError when model, options
  /// and rows do not fit.
  KalmanFilter(const SystemModel& model, const KalmanFilterOptions& options,
               std::vector<std::vector<int>> rows);

  const Estimate& step(std::int64_t step, const MeasurementSet& measurements,
                       const Eigen::VectorXd& known_input) override;

  /// Packets refused since construction.
  std::int64_t refused_packets() const { return correction_.refused_packets(); }

 private:
  KalmanCore core_;
  VectorCorrection correction_;
  Gaussian belief_;
  double score_ = 0.0;
  Estimate estimate_;
};

}  // namespace holdfast
