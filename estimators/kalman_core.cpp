#include "estimators/kalman_core.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/errors.h"

namespace holdfast {
namespace {

// In place, without the temporary that Eigen would need.
void symmetrise(Eigen::MatrixXd& matrix) {
  for (Eigen::Index j = 0; j < matrix.cols(); ++j) {
    for (Eigen::Index i = 0; i < j; ++i) {
      matrix(i, j) = matrix(j, i) = 0.5 * (matrix(i, j) + matrix(j, i));
    }
  }
}

SystemModel checked(const SystemModel& model) {
  const std::vector<std::string> problems = model.problems();
  if (!problems.empty()) throw UsageError("model: " + problems.front());
  return model;
}

bool is_direct(const SystemModel& model, Feedthrough feedthrough) {
  if (feedthrough != Feedthrough::kAuto) return feedthrough == Feedthrough::kDirect;
  return model.H.size() > 0 && !model.H.isZero(0.0);
}

}  // namespace

KalmanCore::KalmanCore(const SystemModel& model, Feedthrough feedthrough,
                       const Gaussian& input_prior)
    : model_(checked(model)),
      is_delayed_(!is_direct(model, feedthrough)),
      n_(model.num_states()),
      m_(model.num_attack_channels()),
      l_(model.num_measurements()),
      input_prior_(input_prior) {
  if (input_prior.mean.size() != m_ || input_prior.covariance.rows() != m_ ||
      input_prior.covariance.cols() != m_) {
    throw UsageError("the attack's prior needs one mean and one variance per attack channel");
  }
  const Eigen::Index d = n_ + m_;
  x_.setZero(n_);
  a_.setZero(m_);
  next_.setZero(n_);
  F_.setZero(n_, d);
  F_a_.setZero(n_, m_);
  FP_.setZero(n_, d);
  state_ = {Eigen::VectorXd::Zero(n_), Eigen::MatrixXd::Zero(n_, n_)};
  y_.setZero(l_);
  nu_.setZero(l_);
  whitened_.setZero(l_);
  J_.setZero(l_, d);
  JP_.setZero(l_, d);
  S_.setZero(l_, l_);
  J_used_.setZero(l_, d);
  JP_used_.setZero(l_, d);
  R_used_.setZero(l_, l_);
  S_used_.setZero(l_, l_);
  L_.setZero(l_, l_);
  K_.setZero(d, l_);
  KR_.setZero(d, l_);
  keep_.setZero(d, d);
  keep_P_.setZero(d, d);
  corrected_.setZero(d, d);
  spread_.setZero(l_, l_);
  rows_.reserve(static_cast<std::size_t>(l_));
}

KalmanCore::KalmanCore(const SystemModel& model)
    : KalmanCore(
          model, Feedthrough::kAuto,
          {Eigen::VectorXd::Zero(model.num_attack_channels()),
           Eigen::MatrixXd::Zero(model.num_attack_channels(), model.num_attack_channels())}) {}

// An input that has acted already, or is not in the belief, is zero at the point.
void KalmanCore::take_point(const Gaussian& belief) {
  x_ = belief.mean.head(n_);
  if (!is_delayed_ && belief.mean.size() > n_) {
    a_ = belief.mean.tail(m_);
  } else {
    a_.setZero();
  }
}

void KalmanCore::predict_state(const Gaussian& belief, Gaussian& state) {
  take_point(belief);
  const Eigen::Index d = is_delayed_ ? n_ : belief.mean.size();
  model_.move(x_, a_, next_);
  model_.move_jacobian(x_, a_, F_);
  F_a_ = F_.rightCols(m_);
  FP_.leftCols(d).noalias() = F_.leftCols(d) * belief.covariance.topLeftCorner(d, d);
  state.mean = next_;
  state.covariance = model_.Q;
  state.covariance.noalias() += FP_.leftCols(d) * F_.leftCols(d).transpose();
  symmetrise(state.covariance);
}

void KalmanCore::join_input(const Gaussian& state, Gaussian& belief) const {
  belief.mean.head(n_) = state.mean.head(n_);
  belief.mean.tail(m_) = input_prior_.mean;
  belief.covariance.topLeftCorner(n_, n_) = state.covariance.topLeftCorner(n_, n_);
  belief.covariance.bottomRightCorner(m_, m_) = input_prior_.covariance;
  auto cross = belief.covariance.topRightCorner(n_, m_);
  if (is_delayed_) {
    belief.mean.head(n_).noalias() += F_a_ * input_prior_.mean;
    cross.noalias() = F_a_ * input_prior_.covariance;
    belief.covariance.topLeftCorner(n_, n_).noalias() += cross * F_a_.transpose();
  } else {
    cross.setZero();
  }
  belief.covariance.bottomLeftCorner(m_, n_) = cross.transpose();
  symmetrise(belief.covariance);
}

void KalmanCore::predict(Gaussian& belief) {
  predict_state(belief, state_);
  if (belief.mean.size() > n_) {
    join_input(state_, belief);
  } else {
    belief = state_;
  }
}

Gaussian KalmanCore::make_input_belief() const {
  if (m_ == 0) throw UsageError("a method with an attack in its state needs a model with one");
  const Eigen::Index d = n_ + m_;
  return {Eigen::VectorXd::Zero(d), Eigen::MatrixXd::Zero(d, d)};
}

void KalmanCore::publish_input(const Gaussian& belief, std::int64_t step,
                               Estimate& estimate) const {
  estimate.input_step = is_delayed_ ? step - 1 : step;
  estimate.input_mean = belief.mean.tail(m_);
  estimate.input_covariance = belief.covariance.bottomRightCorner(m_, m_);
}

void KalmanCore::observe(const Gaussian& belief) {
  take_point(belief);
  size_ = belief.mean.size();
  model_.measure(x_, a_, y_);
  model_.measure_jacobian(x_, a_, J_);
  if (is_delayed_) J_.rightCols(m_).setZero();
  JP_.leftCols(size_).noalias() = J_.leftCols(size_) * belief.covariance;
  S_ = model_.R;
  S_.noalias() += JP_.leftCols(size_) * J_.leftCols(size_).transpose();
}

bool KalmanCore::use_rows(std::span<const int> rows) {
  rows_.assign(rows.begin(), rows.end());
  num_rows_ = static_cast<Eigen::Index>(rows.size());
  for (Eigen::Index i = 0; i < num_rows_; ++i) {
    const int row = rows_[static_cast<std::size_t>(i)];
    J_used_.row(i).head(size_) = J_.row(row).head(size_);
    JP_used_.row(i).head(size_) = JP_.row(row).head(size_);
    for (Eigen::Index j = 0; j < num_rows_; ++j) {
      const int column = rows_[static_cast<std::size_t>(j)];
      R_used_(i, j) = model_.R(row, column);
      // The lower triangle for both, so that rounding leaves S symmetric.
      S_used_(i, j) = S_(std::max(row, column), std::min(row, column));
    }
  }
  auto factor_block = L_.topLeftCorner(num_rows_, num_rows_);
  factor_block = innovation_covariance();
  if (!factor_block.allFinite()) return false;  // LLT takes NaN for a pivot
  Eigen::Ref<Eigen::MatrixXd> in_place(factor_block);
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factor(in_place);
  return factor.info() == Eigen::Success;
}

double KalmanCore::innovate(std::span<const double> values) {
  for (Eigen::Index i = 0; i < num_rows_; ++i) {
    const auto at = static_cast<std::size_t>(i);
    nu_[i] = values[at] - y_[rows_[at]];
  }
  auto whitened = whitened_.head(num_rows_);
  whitened = innovation();
  L_.topLeftCorner(num_rows_, num_rows_).triangularView<Eigen::Lower>().solveInPlace(whitened);
  return whitened.squaredNorm();
}

double KalmanCore::log_density(double squared_distance) const {
  const double rows = static_cast<double>(num_rows_);
  return -0.5 * (squared_distance + rows * std::log(2.0 * std::numbers::pi)) -
         L_.diagonal().head(num_rows_).array().log().sum();
}

// K = (S^-1 J P)', solved on the right: K L' = (J P)' L^-T and so on.
void KalmanCore::find_gain() {
  auto K = K_.topLeftCorner(size_, num_rows_);
  const auto L = L_.topLeftCorner(num_rows_, num_rows_).triangularView<Eigen::Lower>();
  K = JP_used_.topLeftCorner(num_rows_, size_).transpose();
  L.transpose().solveInPlace<Eigen::OnTheRight>(K);
  L.solveInPlace<Eigen::OnTheRight>(K);
}

// (I - K J) P (I - K J)' + K R K'.
void KalmanCore::find_corrected(const Gaussian& belief) {
  const auto K = K_.topLeftCorner(size_, num_rows_);
  auto keep = keep_.topLeftCorner(size_, size_);
  auto corrected = corrected_.topLeftCorner(size_, size_);
  keep.setIdentity();
  keep.noalias() -= K * J_used_.topLeftCorner(num_rows_, size_);
  keep_P_.topLeftCorner(size_, size_).noalias() = keep * belief.covariance;
  corrected.noalias() = keep_P_.topLeftCorner(size_, size_) * keep.transpose();
  KR_.topLeftCorner(size_, num_rows_).noalias() = K * R_used_.topLeftCorner(num_rows_, num_rows_);
  corrected.noalias() += KR_.topLeftCorner(size_, num_rows_) * K.transpose();
}

void KalmanCore::correct(Gaussian& belief) {
  find_gain();
  find_corrected(belief);
  belief.mean.noalias() += K_.topLeftCorner(size_, num_rows_) * innovation();
  belief.covariance = corrected_.topLeftCorner(size_, size_);
  symmetrise(belief.covariance);
}

void KalmanCore::correct_by_mixture(double weight_none,
                                    const Eigen::Ref<const Eigen::VectorXd>& mean,
                                    const Eigen::Ref<const Eigen::MatrixXd>& second,
                                    Gaussian& belief) {
  find_gain();
  find_corrected(belief);
  const auto K = K_.topLeftCorner(size_, num_rows_);
  auto spread = spread_.topLeftCorner(num_rows_, num_rows_);
  spread = second;
  spread.noalias() -= mean * mean.transpose();
  belief.mean.noalias() += K * mean;
  belief.covariance *= weight_none;
  belief.covariance += (1.0 - weight_none) * corrected_.topLeftCorner(size_, size_);
  KR_.topLeftCorner(size_, num_rows_).noalias() = K * spread;
  belief.covariance.noalias() += KR_.topLeftCorner(size_, num_rows_) * K.transpose();
  symmetrise(belief.covariance);
}

void match_moments(double weight, const Gaussian& first, const Gaussian& second, Gaussian& result) {
  const Eigen::Index n = result.mean.size();
  const double other = 1.0 - weight;
  // d d' of the two means about the common one: weight * other * (m1 - m2) (m1 - m2)'.
  result.mean = first.mean.head(n) - second.mean.head(n);
  result.covariance =
      weight * first.covariance.topLeftCorner(n, n) + other * second.covariance.topLeftCorner(n, n);
  result.covariance.noalias() += (weight * other * result.mean) * result.mean.transpose();
  symmetrise(result.covariance);
  result.mean = weight * first.mean.head(n) + other * second.mean.head(n);
}

}  // namespace holdfast
