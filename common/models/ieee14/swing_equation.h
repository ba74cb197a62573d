#pragma once

#include <Eigen/Core>

namespace holdfast {

/// The swing equation of five generators on a reduced network, one sampling step at a time.
///
///   delta_i' = omega_i
///   M_i omega_i' = -D_i omega_i - sum_j l_ij sin(delta_i - delta_j) + sum_c B_ic a_c
///
/// with 1 p.u. voltages behind lossless lines of admittance l_ij = -L_ij, and `a` held over the
/// step. Papers 000 and 003 print no nonlinear equation; they name the small-signal model of the
/// Kron-reduced network, which is this equation's linearisation at equal angles. The sine therefore
/// stands on the lines between generators that the reduction leaves, not on the 20 branches: those
/// would need the angles of nine passive buses from an implicit equation at every evaluation.
///
/// The linear part is integrated exactly, what the sine takes away by a fourth-order Runge-Kutta
/// method in the variables that the linear flow leaves at rest (integrating factor, Lawson 1967).
/// So at equal angles a step and its Jacobian are those of the exactly discretised linear model.
///
/// Symbols: x = [delta rad; omega rad/s] [10], a attack [m], M inertia [p.u. s^2], D damping
/// [p.u. s], L Laplacian [5 x 5, p.u./rad], B [5 x m, p.u. per unit of a].
class SwingEquation {
 public:
  static constexpr int kGenerators = 5, kStates = 2 * kGenerators, kInputsMax = 14;
  using Generators = Eigen::Matrix<double, kGenerators, 1>;
  using GeneratorMatrix = Eigen::Matrix<double, kGenerators, kGenerators>;
  using State = Eigen::Matrix<double, kStates, 1>;

  struct Parameters {
    GeneratorMatrix laplacian;
    Generators inertia, damping;
    Eigen::MatrixXd input;  // B, m <= kInputsMax
  };
  /// A [10 x 10] and G [10 x m] of the linearisation, discretised by an exact zero-order hold.
  struct Linear {
    Eigen::MatrixXd A, G;
  };
  static Linear linearised(const Parameters& parameters, double step_s);

  /// Precondition: inertia > 0, step_s > 0, substeps >= 1.
  SwingEquation(const Parameters& parameters, double step_s, int substeps);

  /// The state one step later; an empty `a` is zero. `next` must have its size.
  void move(const Eigen::VectorXd& x, const Eigen::VectorXd& a, Eigen::VectorXd& next) const;
  /// Jacobian of move by [x; a], [10 x (10 + m)], of the discrete map itself.
  void jacobian(const Eigen::VectorXd& x, const Eigen::VectorXd& a, Eigen::MatrixXd& F) const;

 private:
  using Sensitivity = Eigen::Matrix<double, kStates, Eigen::Dynamic, Eigen::ColMajor, kStates,
                                    kStates + kInputsMax>;

  State drift(const Eigen::VectorXd& a) const;
  State pull(const State& x) const;
  void pull(const State& x, const Sensitivity& dx, Sensitivity& result) const;
  void advance(const State& drift, State& x) const;
  void advance(const State& drift, State& x, Sensitivity& dx) const;

  Eigen::Matrix<double, kStates, kStates> half_;  // exp(A_c h / 2), h: length of a sub-step
  Eigen::MatrixXd half_input_;                    // its zero-order hold
  GeneratorMatrix stiffness_;                     // l_ij / M_i, no diagonal
  double substep_s_;
  int substeps_;
};

}  // namespace holdfast
