#include "common/models/ieee14/swing_equation.h"

#include <cmath>

#include "common/models/ieee14/ieee14_model.h"
#include "tests/support/catch.h"

using namespace holdfast;

namespace {

SwingEquation::Parameters parameters_of(double damping) {
  const Ieee14Network network = ieee14_network();
  SwingEquation::Parameters parameters;
  parameters.laplacian = network.laplacian;
  parameters.inertia << 0.003, 0.007, 0.003, 0.004, 0.006;
  parameters.damping.setConstant(damping);
  parameters.input.resize(5, 2);
  parameters.input << -network.participation.col(2), -network.participation.col(8);
  return parameters;
}

// Angles some tenths of a radian apart, up to pi / 2 from each other.
Eigen::VectorXd wide_state() {
  Eigen::VectorXd x(10);
  x << 0.9, -0.6, 0.3, -0.2, 0.1, 1.0, -2.0, 0.5, 3.0, -1.0;
  return x;
}

// The header's equation by itself, integrated by the classic method in many steps.
Eigen::VectorXd integrated(const SwingEquation::Parameters& p, Eigen::VectorXd x,
                           const Eigen::VectorXd& a, double step_s, int steps) {
  const auto slope = [&](const Eigen::VectorXd& z) {
    Eigen::VectorXd result(10);
    for (int i = 0; i < 5; ++i) {
      double power = (p.input * a)[i] - p.damping[i] * z[5 + i];
      for (int j = 0; j < 5; ++j) power += p.laplacian(i, j) * (i != j) * std::sin(z[i] - z[j]);
      result[i] = z[5 + i];
      result[5 + i] = power / p.inertia[i];
    }
    return result;
  };
  const double h = step_s / steps;
  for (int s = 0; s < steps; ++s) {
    const Eigen::VectorXd k1 = slope(x), k2 = slope(x + 0.5 * h * k1), k3 = slope(x + 0.5 * h * k2),
                          k4 = slope(x + h * k3);
    x += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
  }
  return x;
}

double energy(const SwingEquation::Parameters& p, const Eigen::VectorXd& x) {
  double sum = 0.0;
  for (int i = 0; i < 5; ++i) {
    sum += 0.5 * p.inertia[i] * x[5 + i] * x[5 + i];
    for (int j = 0; j < i; ++j) sum -= p.laplacian(i, j) * (1.0 - std::cos(x[i] - x[j]));
  }
  return sum;
}

}  // namespace

TEST_CASE("a swing step agrees with the classic method in many steps, of fourth order") {
  const SwingEquation::Parameters parameters = parameters_of(0.002);
  const Eigen::VectorXd x = wide_state(), a = Eigen::Vector2d(0.2, 0.1);
  const Eigen::VectorXd truth = integrated(parameters, x, a, 0.01, 400);
  const auto error = [&](int substeps) {
    Eigen::VectorXd next(10);
    SwingEquation(parameters, 0.01, substeps).move(x, a, next);
    return (next - truth).cwiseAbs().maxCoeff();
  };
  CHECK(error(4) < 1e-6);
  // Halving the step divides the error by 16, here to within what the next order adds.
  CHECK(error(2) / error(4) == Approx(16.0).epsilon(0.25));
  CHECK(error(4) / error(8) == Approx(16.0).epsilon(0.25));
}

TEST_CASE("without damping and attack the energy stays") {
  const SwingEquation::Parameters parameters = parameters_of(0.0);
  const SwingEquation swing(parameters, 0.01, 4);
  Eigen::VectorXd x = wide_state(), next(10);
  const double at_start = energy(parameters, x);
  for (int k = 0; k < 1000; ++k) {
    swing.move(x, Eigen::VectorXd(), next);
    x = next;
  }
  CHECK(energy(parameters, x) == Approx(at_start).epsilon(1e-4));
  const SwingEquation damped(parameters_of(0.002), 0.01, 4);
  for (int k = 0; k < 1000; ++k) {
    damped.move(x, Eigen::VectorXd(), next);
    x = next;
  }
  CHECK(energy(parameters, x) < 0.5 * at_start);
}

TEST_CASE("turning every rotor by one angle turns the next state by it") {
  const SwingEquation swing(parameters_of(0.002), 0.01, 4);
  const Eigen::VectorXd x = wide_state(), a = Eigen::Vector2d(0.2, 0.1);
  Eigen::VectorXd turned = x, next(10), next_turned(10);
  turned.head(5).array() += 2.5;
  swing.move(x, a, next);
  swing.move(turned, a, next_turned);
  next.head(5).array() += 2.5;
  CHECK((next_turned - next).cwiseAbs().maxCoeff() < 1e-13);
}

TEST_CASE("the Jacobian of a swing step is its derivative") {
  const SwingEquation swing(parameters_of(0.002), 0.01, 4);
  const Eigen::VectorXd x = wide_state(), a = Eigen::Vector2d(0.2, 0.1);
  Eigen::MatrixXd F(10, 12);
  swing.jacobian(x, a, F);
  // Central differences: error h^2 times a third derivative of at most about 10, and rounding.
  const double h = 1e-5;
  for (int c = 0; c < 12; ++c) {
    Eigen::VectorXd x_high = x, x_low = x, a_high = a, a_low = a, high(10), low(10);
    (c < 10 ? x_high[c] : a_high[c - 10]) += h;
    (c < 10 ? x_low[c] : a_low[c - 10]) -= h;
    swing.move(x_high, a_high, high);
    swing.move(x_low, a_low, low);
    CHECK(((high - low) / (2.0 * h) - F.col(c)).cwiseAbs().maxCoeff() < 2e-9);
  }
}
