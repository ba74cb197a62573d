#include "common/models/ieee14/swing_equation.h"

#include <cmath>
#include <unsupported/Eigen/MatrixFunctions>

namespace holdfast {

SwingEquation::Linear SwingEquation::linearised(const Parameters& parameters, double step_s) {
  const Eigen::Index m = parameters.input.cols();
  const Generators per_inertia = parameters.inertia.cwiseInverse();
  Eigen::MatrixXd continuous = Eigen::MatrixXd::Zero(kStates + m, kStates + m);
  continuous.block<kGenerators, kGenerators>(0, kGenerators).setIdentity();
  auto rates = continuous.middleRows<kGenerators>(kGenerators);
  rates.leftCols<kGenerators>() = -(per_inertia.asDiagonal() * parameters.laplacian);
  rates.middleCols<kGenerators>(kGenerators) =
      Generators(-per_inertia.cwiseProduct(parameters.damping)).asDiagonal();
  rates.rightCols(m) = per_inertia.asDiagonal() * parameters.input;
  const Eigen::MatrixXd discrete = (step_s * continuous).exp();
  return {discrete.topLeftCorner(kStates, kStates), discrete.topRightCorner(kStates, m)};
}

SwingEquation::SwingEquation(const Parameters& parameters, double step_s, int substeps)
    : substep_s_(step_s / substeps), substeps_(substeps) {
  const Linear half = linearised(parameters, 0.5 * substep_s_);
  half_ = half.A;
  half_input_ = half.G;
  stiffness_ = -(parameters.inertia.cwiseInverse().asDiagonal() * parameters.laplacian);
  stiffness_.diagonal().setZero();
}

void SwingEquation::move(const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                         Eigen::VectorXd& next) const {
  State state = x;
  const State input = drift(a);
  for (int i = 0; i < substeps_; ++i) advance(input, state);
  next = state;
}

void SwingEquation::jacobian(const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                             Eigen::MatrixXd& F) const {
  State state = x;
  const State input = drift(a);
  Sensitivity dx = Sensitivity::Zero(kStates, kStates + half_input_.cols());
  dx.leftCols<kStates>().setIdentity();
  for (int i = 0; i < substeps_; ++i) advance(input, state, dx);
  F = dx;
}

// What the held input adds to the state in half a sub-step.
SwingEquation::State SwingEquation::drift(const Eigen::VectorXd& a) const {
  State result = State::Zero();
  if (a.size() > 0) result.noalias() += half_input_ * a;
  return result;
}

// x' - A_c x - B_c a: what the linearisation pulls too much.
SwingEquation::State SwingEquation::pull(const State& x) const {
  State result = State::Zero();
  for (int i = 0; i < kGenerators; ++i) {
    for (int j = 0; j < kGenerators; ++j) {
      const double angle = x[i] - x[j];
      result[kGenerators + i] += stiffness_(i, j) * (angle - std::sin(angle));
    }
  }
  return result;
}

void SwingEquation::pull(const State& x, const Sensitivity& dx, Sensitivity& result) const {
  GeneratorMatrix slope = GeneratorMatrix::Zero();
  for (int i = 0; i < kGenerators; ++i) {
    for (int j = 0; j < kGenerators; ++j) {
      const double loss = stiffness_(i, j) * (1.0 - std::cos(x[i] - x[j]));
      slope(i, i) += loss;
      slope(i, j) -= loss;
    }
  }
  result.resize(kStates, dx.cols());
  result.topRows<kGenerators>().setZero();
  result.bottomRows<kGenerators>().noalias() = slope * dx.topRows<kGenerators>();
}

void SwingEquation::advance(const State& drift, State& x) const {
  const double h = substep_s_;
  const State k1 = pull(x);
  const State middle = half_ * x + drift;  // of the linear flow alone
  const State k2 = pull(middle + 0.5 * h * (half_ * k1));
  const State k3 = pull(middle + 0.5 * h * k2);
  const State k4 = pull(half_ * (middle + h * k3) + drift);
  x = (half_ * (middle + h / 6.0 * (half_ * k1 + 2.0 * (k2 + k3))) + drift + h / 6.0 * k4).eval();
}

void SwingEquation::advance(const State& drift, State& x, Sensitivity& dx) const {
  const double h = substep_s_;
  const State k1 = pull(x);
  const State middle = half_ * x + drift;
  const State x2 = middle + 0.5 * h * (half_ * k1);
  const State k2 = pull(x2);
  const State x3 = middle + 0.5 * h * k2;
  const State k3 = pull(x3);
  const State x4 = half_ * (middle + h * k3) + drift;

  Sensitivity dk1, dk2, dk3, dk4, flow = half_ * dx, stage;
  flow.rightCols(half_input_.cols()) += half_input_;
  pull(x, dx, dk1);
  dk1 = (half_ * dk1).eval();  // only ever needed half a sub-step on
  stage = flow + 0.5 * h * dk1;
  pull(x2, stage, dk2);
  stage = flow + 0.5 * h * dk2;
  pull(x3, stage, dk3);
  stage = half_ * (flow + h * dk3);
  stage.rightCols(half_input_.cols()) += half_input_;
  pull(x4, stage, dk4);
  dx.noalias() = half_ * (flow + h / 6.0 * (dk1 + 2.0 * (dk2 + dk3)));
  dx.rightCols(half_input_.cols()) += half_input_;
  dx += h / 6.0 * dk4;
  advance(drift, x);
}

}  // namespace holdfast
