#include "tools/bounds/clairvoyant_filter.h"

#include <utility>

namespace holdfast {

ClairvoyantFilter::ClairvoyantFilter(const SystemModel& model,
                                     const ClairvoyantFilterOptions& options,
                                     std::vector<std::vector<int>> rows)
    : core_(model, options.feedthrough, options.attack_prior.gaussian(model.num_attack_channels())),
      inbox_(std::move(rows), model.num_measurements()),
      choice_(PacketRule::kFirst, 1.0, inbox_),
      innovation_(model.num_measurements()),
      predicted_(options.start.gaussian(model.num_states())),
      state_(predicted_),
      joint_(core_.make_input_belief()) {}

const Estimate& ClairvoyantFilter::step(std::int64_t step, const MeasurementSet& measurements,
                                        const Eigen::VectorXd& /*known_input*/) {
  inbox_.read(measurements);
  inbox_.begin(step, measurements, estimate_);
  Gaussian& belief = predict();
  KalmanMode mode{&core_, &belief};
  const PacketChoice::Result result = choice_.correct(inbox_, {&mode, 1}, estimate_);
  innovation_.clear(estimate_);
  if (result == PacketChoice::Result::kCorrected) {
    innovation_.publish(core_.innovation(), core_.innovation_covariance(), estimate_);
  }
  publish(belief, step);
  return estimate_;
}

Gaussian& ClairvoyantFilter::predict() {
  if (has_started_) core_.predict_state(has_input_ ? joint_ : state_, predicted_);
  has_started_ = true;
  has_input_ = core_.is_delayed() ? was_attacked_ : is_attacked_;
  was_attacked_ = is_attacked_;
  if (has_input_) {
    core_.join_input(predicted_, joint_);
    return joint_;
  }
  state_ = predicted_;
  return state_;
}

void ClairvoyantFilter::publish(const Gaussian& belief, std::int64_t step) {
  const Eigen::Index n = state_.mean.size();
  estimate_.mean = belief.mean.head(n);
  estimate_.covariance = belief.covariance.topLeftCorner(n, n);
  estimate_.attack_probability = has_input_ ? 1.0 : 0.0;
  core_.publish_input(joint_, step, estimate_);
  if (has_input_) return;
  estimate_.input_mean.setZero();
  estimate_.input_covariance.setZero();
}

}  // namespace holdfast
