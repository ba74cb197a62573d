#include "estimators/joint_input_state.h"

#include <Eigen/Cholesky>
#include <utility>

#include "common/chi_square.h"
#include "common/errors.h"

namespace holdfast {

InputScore::InputScore(const Gaussian& prior)
    : difference_(prior.mean.size()), factor_(prior.mean.size(), prior.mean.size()) {
  const Eigen::LLT<Eigen::MatrixXd> llt(prior.covariance);
  if (llt.info() != Eigen::Success) {
    throw UsageError("the attack's prior needs a positive definite covariance");
  }
  prior_information_ = llt.solve(prior.mean);
}

double InputScore::operator()(const Gaussian& posterior) {
  const Eigen::Index m = prior_information_.size();
  if (m == 0) return 0.0;
  factor_ = posterior.covariance.bottomRightCorner(m, m);
  // i' P_aa i = d' P_aa^-1 d with d = a^ - P_aa Pa^-1 a0.
  difference_ = posterior.mean.tail(m);
  difference_.noalias() -= factor_ * prior_information_;
  Eigen::Ref<Eigen::MatrixXd> in_place(factor_);
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(in_place);
  if (llt.info() != Eigen::Success) return 0.0;
  factor_.triangularView<Eigen::Lower>().solveInPlace(difference_);
  return chi_square_distribution(difference_.squaredNorm(), static_cast<double>(m));
}

JointInputState::JointInputState(const SystemModel& model, const JointInputStateOptions& options,
                                 std::vector<std::vector<int>> rows)
    : attack_prior_(options.attack_prior.gaussian(model.num_attack_channels())),
      core_(model, options.feedthrough, attack_prior_),
      correction_(std::move(rows), model.num_measurements(), options.vector),
      belief_(core_.make_input_belief()),
      input_score_(attack_prior_) {
  core_.join_input(options.start.gaussian(model.num_states()), belief_);
}

const Estimate& JointInputState::step(std::int64_t step, const MeasurementSet& measurements,
                                      const Eigen::VectorXd& /*known_input*/) {
  using Result = PacketChoice::Result;
  const Result result = correction_.step(step, measurements, core_, belief_, estimate_);
  if (result == Result::kCorrected) {
    score_ = input_score_(belief_);
  } else if (result == Result::kRefusedByGate) {
    score_ = correction_.refused_score();
  }
  estimate_.mean = belief_.mean.head(core_.num_states());
  estimate_.covariance = belief_.covariance.topLeftCorner(core_.num_states(), core_.num_states());
  core_.publish_input(belief_, step, estimate_);
  estimate_.attack_probability = score_;
  return estimate_;
}

}  // namespace holdfast
