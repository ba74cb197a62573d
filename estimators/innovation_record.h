#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimators/estimate.h"

namespace holdfast {

/// Publishes innovations of changing size without allocating: one buffer per number of rows, since
/// an Eigen matrix gives its memory back whenever its size changes.
class InnovationRecord {
 public:
  explicit InnovationRecord(int rows_max);

  /// The estimate says no innovation.
  void clear(Estimate& estimate);
  /// The estimate says this innovation and its covariance.
  void publish(const Eigen::Ref<const Eigen::VectorXd>& nu,
               const Eigen::Ref<const Eigen::MatrixXd>& S, Estimate& estimate);
  /// The estimate has an innovation and a covariance of this many rows, for the caller to fill.
  void make_room(std::size_t rows, Estimate& estimate) { swap(rows, estimate); }

 private:
  void swap(std::size_t rows, Estimate& estimate);

  std::vector<Eigen::VectorXd> innovations_;
  std::vector<Eigen::MatrixXd> covariances_;
};

}  // namespace holdfast
