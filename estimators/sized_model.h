#pragma once

#include <cstddef>
#include <vector>

#include "common/models/system_model.h"
#include "estimators/gaussian_update.h"
#include "estimators/sigma_points.h"
#include "estimators/small_factor.h"

namespace holdfast {

/// A SystemModel in the sizes of a filter, without attack signals: moves and observes beliefs.
template <int N, int L>
class SizedModel {
 public:
  /// Precondition: the model has no problems() and its sizes are N and L, or at most kSmallSizeMax.
  SizedModel(const SystemModel& model, Linearisation linearisation)
      : model_(model),
        points_(linearisation == Linearisation::kCubature ? SigmaRule::cubature()
                                                          : SigmaRule::unscented()),
        is_extended_(linearisation == Linearisation::kExtended),
        F_(model.A),
        Q_(model.Q),
        H_(model.C),
        R_(model.R),
        x_(model.num_states()),
        a_(Eigen::VectorXd::Zero(model.num_attack_channels())),
        next_(model.num_states()),
        y_(model.num_measurements()),
        moved_(model.num_states(), model.num_states() + model.num_attack_channels()),
        measured_(model.num_measurements(), model.num_states() + model.num_attack_channels()) {}

  const Small<L, L>& R() const { return R_; }

  /// See predict_linear().
  void predict(const Belief<N>& belief, Small<N, N>& cross, Belief<N>& next) {
    if (!model_.transition) return predict_linear(F_, Q_, belief, cross, next);
    if (is_extended_) {
      x_ = belief.mean;
      model_.move_jacobian(x_, a_, moved_);
      F_ = moved_.leftCols(x_.size());
      predict_linear(F_, Q_, belief, cross, next);
      model_.move(x_, a_, next_);
      next.mean = next_;
      return;
    }
    const auto move = [this](const Eigen::VectorXd& x) -> const Eigen::VectorXd& {
      model_.move(x, a_, next_);
      return next_;
    };
    next.covariance.resize(x_.size(), x_.size());
    spread<N>(belief, move, next.mean, next.covariance, cross);
    next.covariance += Q_;
  }

  void observe(const Belief<N>& belief, Observation<N, L>& observation) {
    if (!model_.measurement) return observe_linear(H_, belief, observation);
    if (is_extended_) {
      x_ = belief.mean;
      model_.measure_jacobian(x_, a_, measured_);
      H_ = measured_.leftCols(x_.size());
      observe_linear(H_, belief, observation);
      model_.measure(x_, a_, y_);
      observation.h = y_;
      return;
    }
    const auto measure = [this](const Eigen::VectorXd& x) -> const Eigen::VectorXd& {
      model_.measure(x, a_, y_);
      return y_;
    };
    spread<L>(belief, measure, observation.h, observation.Phh, observation.Pxh);
    regress(belief, observation);
  }

 private:
  // The linear part of what sigma points say, and what it leaves; none where P is not definite.
  // Summed from what each point leaves, which is no difference of large numbers, and has no
  // negative eigenvalue.
  void regress(const Belief<N>& belief, Observation<N, L>& observation) {
    observation.has_jacobian = factor_.factorise(belief.covariance);
    observation.has_unexplained = observation.has_jacobian;
    if (!observation.has_jacobian) return;
    observation.J = observation.Pxh.transpose();
    factor_.solve_right(observation.J);
    const auto n = belief.mean.size();
    observation.unexplained.setZero(observation.h.size(), observation.h.size());
    for (int i = 0; i < points_.count(); ++i) {
      const Small<N> from_mean = Eigen::Map<const Small<N>>(points_.point(i), n) - belief.mean;
      const Small<L> left = values_[static_cast<std::size_t>(i)] - observation.h -
                            observation.J.lazyProduct(from_mean);
      observation.unexplained.noalias() += (points_.covariance_weight(i) * left) * left.transpose();
    }
    symmetrise_small(observation.unexplained);
  }

  // Mean and covariance of function(x), and its covariance with x, by sigma points.
  template <int M, class Function>
  void spread(const Belief<N>& belief, const Function& function, Small<M>& mean,
              Small<M, M>& covariance, Small<N, M>& cross) {
    const auto n = static_cast<int>(belief.mean.size());
    points_.set(belief.mean.data(), belief.covariance.data(), n, n);
    values_.resize(static_cast<std::size_t>(points_.count()));
    for (int i = 0; i < points_.count(); ++i) {
      x_ = Eigen::Map<const Eigen::VectorXd>(points_.point(i), n);
      Eigen::VectorXd& value = values_[static_cast<std::size_t>(i)];
      value = function(x_);
      if (i == 0) mean.setZero(value.size());
      mean += points_.weight(i) * value;
    }
    covariance.setZero(mean.size(), mean.size());
    cross.setZero(n, mean.size());
    for (int i = 0; i < points_.count(); ++i) {
      const Small<M> apart = values_[static_cast<std::size_t>(i)] - mean;
      covariance.noalias() += (points_.covariance_weight(i) * apart) * apart.transpose();
      const Small<N> from_mean = Eigen::Map<const Small<N>>(points_.point(i), n) - belief.mean;
      cross.noalias() += (points_.weight(i) * from_mean) * apart.transpose();
    }
    symmetrise_small(covariance);
  }

  SystemModel model_;
  SigmaPoints points_;
  bool is_extended_;
  Small<N, N> F_, Q_;
  Small<L, N> H_;
  Small<L, L> R_;
  SmallFactor<N> factor_;
  Eigen::VectorXd x_, a_, next_, y_;
  Eigen::MatrixXd moved_, measured_;
  std::vector<Eigen::VectorXd> values_;
};

}  // namespace holdfast
