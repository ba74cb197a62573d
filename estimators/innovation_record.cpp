#include "estimators/innovation_record.h"

namespace holdfast {

InnovationRecord::InnovationRecord(int rows_max) {
  for (int rows = 0; rows <= rows_max; ++rows) {
    innovations_.emplace_back(rows);
    covariances_.emplace_back(rows, rows);
  }
}

// What the estimate holds goes back to the place of its size.
void InnovationRecord::swap(std::size_t rows, Estimate& estimate) {
  const auto held = static_cast<std::size_t>(estimate.innovation.size());
  if (held == rows) return;
  estimate.innovation.swap(innovations_[held]);
  estimate.innovation_covariance.swap(covariances_[held]);
  estimate.innovation.swap(innovations_[rows]);
  estimate.innovation_covariance.swap(covariances_[rows]);
}

void InnovationRecord::clear(Estimate& estimate) {
  swap(0, estimate);
}

void InnovationRecord::publish(const Eigen::Ref<const Eigen::VectorXd>& nu,
                               const Eigen::Ref<const Eigen::MatrixXd>& S, Estimate& estimate) {
  swap(static_cast<std::size_t>(nu.size()), estimate);
  estimate.innovation = nu;
  estimate.innovation_covariance = S;
}

}  // namespace holdfast
