#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "common/models/system_model.h"
#include "estimators/estimate.h"

namespace holdfast {

/// Mean and covariance of a belief: on x [n], or on z = [x; a] [n + m].
struct Gaussian {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

/// Where an attack shows: y_k tells of a_k (direct, H != 0) or first of a_{k-1} (delayed, H = 0).
enum class Feedthrough {
  kAuto,  // direct when H != 0
  kDirect,
  kDelayed
};

/// The arithmetic of an extended Kalman filter with or without an unknown input in its state; exact
/// for a linear model. One thread; allocates nothing after construction.
///
/// A belief says by its size what it is: [n] is x without attack, [n + m] is z = [x; a], where `a`
/// is a_k (direct) or a_{k-1} (delayed). Every fresh `a` has the prior N(a0, Pa), eq. (73) of paper
/// 000.
///
/// Symbols: F_x, F_a Jacobians of the motion, J [l x n or n + m] of the measurement, S innovation
/// covariance, K gain, nu innovation; the others are SystemModel's.
///
/// One step: predict, observe, then for some rows of y use_rows, innovate, correct.
class KalmanCore {
 public:
  /// Throws UsageError when the model has problems() or the prior does not fit it.
  KalmanCore(const SystemModel& model, Feedthrough feedthrough, const Gaussian& input_prior);
  /// For beliefs on x only.
  explicit KalmanCore(const SystemModel& model);

  bool is_delayed() const { return is_delayed_; }
  int num_states() const { return n_; }

  /// x one step later: mean f(x, a), P = F [..] F' + Q; a = 0 for a belief on x. Delayed: a_{k-1}
  /// has acted already, so only the x part of z goes on.
  void predict_state(const Gaussian& belief, Gaussian& state);
  /// Joins x with a fresh input. Direct: independent. Delayed: the input acted on the way to x, so
  /// mean [x + F_a a0; a0], covariance [[P + F_a Pa F_a', F_a Pa], [Pa F_a', Pa]] with F_a of the
  /// latest predict_state; independent before the first one.
  void join_input(const Gaussian& state, Gaussian& belief) const;
  /// predict_state, and for a belief on z join_input, in place.
  void predict(Gaussian& belief);

  /// A belief on z of zeros, to join_input into; throws UsageError when the model has no attack
  /// channel.
  Gaussian make_input_belief() const;
  /// The input part of a belief on z, and its step: k, or k - 1 when delayed.
  void publish_input(const Gaussian& belief, std::int64_t step, Estimate& estimate) const;

  /// h and its Jacobian at the belief, and J P J' over all rows of y.
  void observe(const Gaussian& belief);
  /// Picks rows of y and factorises their S; false when S is not positive definite.
  bool use_rows(std::span<const int> rows);
  /// nu of the rows in use; returns nu' S^-1 nu.
  double innovate(std::span<const double> values);
  /// log N(nu; 0, S) for that squared distance.
  double log_density(double squared_distance) const;
  /// Kalman update by the latest innovation, covariance in Joseph form.
  void correct(Gaussian& belief);
  /// Update by a mixture of packets, moments matched: with probability weight_none none of them was
  /// true; mean = sum w nu and second = sum w nu nu' over the packets, of num_rows() rows.
  void correct_by_mixture(double weight_none, const Eigen::Ref<const Eigen::VectorXd>& mean,
                          const Eigen::Ref<const Eigen::MatrixXd>& second, Gaussian& belief);

  int num_rows() const { return static_cast<int>(num_rows_); }
  auto innovation() const { return nu_.head(num_rows_); }
  auto innovation_covariance() const { return S_used_.topLeftCorner(num_rows_, num_rows_); }

 private:
  void take_point(const Gaussian& belief);
  void find_gain();
  void find_corrected(const Gaussian& belief);

  SystemModel model_;
  bool is_delayed_;
  int n_, m_, l_;
  Gaussian input_prior_;

  Eigen::VectorXd x_, a_, next_;  // the point of linearisation, and f there
  Eigen::MatrixXd F_, F_a_, FP_;  // by [x; a]; by a; F P
  Gaussian state_;

  Eigen::VectorXd y_, nu_, whitened_;
  Eigen::MatrixXd J_, JP_, S_;                              // all rows
  Eigen::MatrixXd J_used_, JP_used_, R_used_, S_used_, L_;  // rows in use
  Eigen::MatrixXd K_, KR_, keep_, keep_P_, corrected_, spread_;
  std::vector<int> rows_;
  Eigen::Index size_ = 0, num_rows_ = 0;  // of the belief observed; of the rows in use
};

/// The Gaussian on x with the moments of weight N_first + (1 - weight) N_second, of which only the
/// x parts count. `result` [n] must be neither of them.
void match_moments(double weight, const Gaussian& first, const Gaussian& second, Gaussian& result);

}  // namespace holdfast
