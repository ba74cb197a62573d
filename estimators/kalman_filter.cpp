#include "estimators/kalman_filter.h"

#include <utility>

#include "common/chi_square.h"

namespace holdfast {

KalmanFilter::KalmanFilter(const SystemModel& model, const KalmanFilterOptions& options,
                           std::vector<std::vector<int>> rows)
    : core_(model),
      inbox_(std::move(rows), model.num_measurements()),
      choice_(options.vector.packet, options.vector.gate_probability, inbox_),
      innovation_(model.num_measurements()),
      belief_(options.start.gaussian(model.num_states())) {}

const Estimate& KalmanFilter::step(std::int64_t step, const MeasurementSet& measurements,
                                   const Eigen::VectorXd& /*known_input*/) {
  using Result = PacketChoice::Result;
  inbox_.read(measurements);
  inbox_.begin(step, measurements, estimate_);
  if (has_started_) core_.predict(belief_);
  has_started_ = true;
  KalmanMode mode{&core_, &belief_};
  const Result result = choice_.correct(inbox_, {&mode, 1}, estimate_);
  innovation_.clear(estimate_);
  if (result == Result::kCorrected) {
    innovation_.publish(core_, estimate_);
    score_ = chi_square_distribution(mode.distance, core_.num_rows());
  } else if (result == Result::kRefusedByGate) {
    score_ = choice_.refused_score();
  }
  estimate_.mean = belief_.mean;
  estimate_.covariance = belief_.covariance;
  estimate_.attack_probability = score_;
  return estimate_;
}

}  // namespace holdfast
