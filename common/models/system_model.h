#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

namespace holdfast {

/// A plant with vector measurements, known inputs and additive attack signals; values and pure
/// functions only.
///
///   x_{k+1} = f(x_k, a_k) + B u_k + w_k,  w ~ N(0, Q)      linear: f = A x + G a
///   y_k     = h(x_k, a_k) + D u_k + v_k,  v ~ N(0, R)      linear: h = C x + H a
///
/// Symbols: A [n x n], C [l x n], B [n x q] and D [l x q] of the known inputs, G [n x m] and H
/// [l x m] of the attack channels, Q [n x n] process noise covariance, R [l x l] measurement noise
/// covariance. q and m may be 0.
struct SystemModel {
  /// next or measured = function(x [n], a [m]); writes into a vector of the right size.
  using Function = std::function<void(const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                                      Eigen::VectorXd& result)>;
  /// Jacobian by [x; a] at a point; writes into a matrix of the right size, [.. x (n + m)].
  using Jacobian = std::function<void(const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                                      Eigen::MatrixXd& result)>;

  Eigen::MatrixXd A, C, G, H, Q, R;
  Eigen::MatrixXd B, D;  // empty, or both of q columns
  // Set for a nonlinear model; the matrices above are then its linearisation at the origin. A
  // function that is set has its Jacobian set too.
  Function transition, measurement;
  Jacobian transition_jacobian, measurement_jacobian;

  double step_s = 1.0;
  std::vector<std::string> state_names;        // with units, e.g. "omega_1_radps"; n
  std::vector<std::string> measurement_names;  // l
  std::vector<std::string> attack_names;       // m
  std::vector<std::string> input_names;        // q

  int num_states() const { return static_cast<int>(A.rows()); }
  int num_measurements() const { return static_cast<int>(C.rows()); }
  int num_attack_channels() const { return static_cast<int>(G.cols()); }
  int num_inputs() const { return static_cast<int>(B.cols()); }
  bool is_linear() const { return !transition && !measurement; }

  /// f and h at a point, linear or not; allocates nothing when the result has its size.
  void move(const Eigen::VectorXd& x, const Eigen::VectorXd& a, Eigen::VectorXd& next) const;
  void measure(const Eigen::VectorXd& x, const Eigen::VectorXd& a, Eigen::VectorXd& y) const;
  /// Jacobians by [x; a]: [n x (n + m)] and [l x (n + m)].
  void move_jacobian(const Eigen::VectorXd& x, const Eigen::VectorXd& a, Eigen::MatrixXd& F) const;
  void measure_jacobian(const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                        Eigen::MatrixXd& J) const;

  /// What is wrong with sizes, symmetry and definiteness (Q >= 0, R > 0); empty when all is well.
  std::vector<std::string> problems() const;
  /// The same plant with only these attack channels, in this order.
  SystemModel with_attack_channels(const std::vector<int>& channels) const;
};

}  // namespace holdfast
