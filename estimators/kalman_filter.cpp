#include "estimators/kalman_filter.h"

#include <utility>

#include "common/chi_square.h"

namespace holdfast {

KalmanFilter::KalmanFilter(const SystemModel& model, const KalmanFilterOptions& options,
                           std::vector<std::vector<int>> rows)
    : core_(model),
      correction_(std::move(rows), model.num_measurements(), options.vector),
      belief_(options.start.gaussian(model.num_states())) {}

const Estimate& KalmanFilter::step(std::int64_t step, const MeasurementSet& measurements,
                                   const Eigen::VectorXd& /*known_input*/) {
  using Result = PacketChoice::Result;
  const Result result = correction_.step(step, measurements, core_, belief_, estimate_);
  if (result == Result::kCorrected) {
    score_ = chi_square_distribution(correction_.distance(), core_.num_rows());
  } else if (result == Result::kRefusedByGate) {
    score_ = correction_.refused_score();
  }
  estimate_.mean = belief_.mean;
  estimate_.covariance = belief_.covariance;
  estimate_.attack_probability = score_;
  return estimate_;
}

}  // namespace holdfast
