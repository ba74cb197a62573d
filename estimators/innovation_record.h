#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimators/estimate.h"
#include "estimators/kalman_core.h"

namespace holdfast {

/// Publishes innovations of changing size without allocating: one buffer per number of rows, since
/// an Eigen matrix gives its memory back whenever its size changes.
class InnovationRecord {
 public:
  explicit InnovationRecord(int rows_max);

  /// The estimate says no innovation.
  void clear(Estimate& estimate);
  /// The estimate says the core's latest innovation, and its covariance.
  void publish(const KalmanCore& core, Estimate& estimate);

 private:
  void swap(std::size_t rows, Estimate& estimate);

  std::vector<Eigen::VectorXd> innovations_;
  std::vector<Eigen::MatrixXd> covariances_;
};

}  // namespace holdfast
