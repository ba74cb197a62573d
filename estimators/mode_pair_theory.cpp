#include "estimators/mode_pair_theory.h"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <utility>

namespace holdfast {
namespace {

constexpr double kPairTolerance = 1e-9;  // of the largest singular value
constexpr double kStable = 1.0 - 1e-9;

struct Spaces {
  Eigen::MatrixXd range, kernel;  // orthonormal columns: of the matrix's range; of its kernel
};

Spaces spaces_of(const Eigen::MatrixXd& matrix) {
  const Eigen::Index columns = matrix.cols();
  if (matrix.rows() == 0 || columns == 0) {
    return {Eigen::MatrixXd(matrix.rows(), 0), Eigen::MatrixXd::Identity(columns, columns)};
  }
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::VectorXd& values = svd.singularValues();
  const double smallest = kPairTolerance * std::max(1.0, values[0]);
  const Eigen::Index rank = (values.array() > smallest).count();
  return {svd.matrixU().leftCols(rank), svd.matrixV().rightCols(columns - rank)};
}

Eigen::MatrixXd complement(const Eigen::MatrixXd& basis) {
  return spaces_of(basis.transpose()).kernel;
}

// Both modes side by side; the output is how far their readings lie apart.
struct JointSystem {
  Eigen::MatrixXd A, B, C, D;

  JointSystem(const SystemModel& one, const SystemModel& other) {
    const Eigen::Index n = one.A.rows(), l = one.C.rows();
    const Eigen::Index p = one.G.cols(), q = other.G.cols();
    A = Eigen::MatrixXd::Zero(2 * n, 2 * n);
    A.topLeftCorner(n, n) = one.A;
    A.bottomRightCorner(n, n) = other.A;
    B = Eigen::MatrixXd::Zero(2 * n, p + q);
    B.topLeftCorner(n, p) = one.G;
    B.bottomRightCorner(n, q) = other.G;
    C.resize(l, 2 * n);
    C << one.C, -other.C;
    D.resize(l, p + q);
    D << one.H, -other.H;
    for (Eigen::Index i = 0; i < B.cols(); ++i) {
      const double norm = std::hypot(B.col(i).norm(), D.col(i).norm());
      if (norm == 0.0) continue;
      B.col(i) /= norm;
      D.col(i) /= norm;
    }
  }
};

// What keeps the output at zero for ever: states, and for each of them an input.
struct SilentMotion {
  Eigen::MatrixXd states;     // V: orthonormal columns
  Eigen::MatrixXd dynamics;   // of the coordinates in V, with inputs that keep it there
  Eigen::MatrixXd reachable;  // by inputs that stay silent, in coordinates of V
};

// The part of the space of states that inputs can steer, [columns of space].
Eigen::MatrixXd controllable(const Eigen::MatrixXd& dynamics, const Eigen::MatrixXd& inputs) {
  Eigen::MatrixXd reached = spaces_of(inputs).range;
  while (true) {
    Eigen::MatrixXd more(dynamics.rows(), 2 * reached.cols());
    more << reached, dynamics * reached;
    Eigen::MatrixXd next = spaces_of(more).range;
    if (next.cols() == reached.cols()) return reached;
    reached = std::move(next);
  }
}

SilentMotion silent_motion(const JointSystem& system) {
  const Eigen::Index n = system.A.rows(), m = system.B.cols(), l = system.C.rows();
  Eigen::MatrixXd V = Eigen::MatrixXd::Identity(n, n);
  while (true) {
    // States in V, in its coordinates, and inputs that lead back into V with no output.
    const Eigen::MatrixXd away = Eigen::MatrixXd::Identity(n, n) - V * V.transpose();
    Eigen::MatrixXd condition(n + l, V.cols() + m);
    condition << away * system.A * V, away * system.B, system.C * V, system.D;
    const Eigen::MatrixXd kernel = spaces_of(condition).kernel;
    const Eigen::MatrixXd kept = spaces_of(kernel.topRows(V.cols())).range;
    if (kept.cols() < V.cols()) {
      V = (V * kept).eval();
      if (V.cols() == 0) return {V, Eigen::MatrixXd(0, 0), Eigen::MatrixXd(0, 0)};
      continue;
    }
    const Eigen::MatrixXd of_states = kernel.topRows(V.cols()), of_inputs = kernel.bottomRows(m);
    const Eigen::MatrixXd feedback =
        of_inputs * of_states.completeOrthogonalDecomposition().pseudoInverse();
    const Eigen::MatrixXd free = of_inputs * spaces_of(of_states).kernel;
    const Eigen::MatrixXd dynamics = V.transpose() * (system.A * V + system.B * feedback);
    return {V, dynamics, controllable(dynamics, V.transpose() * (system.B * free))};
  }
}

}  // namespace

bool is_state_common(const SystemModel& one, const SystemModel& other) {
  const Eigen::Index n = one.A.rows();
  const SilentMotion motion = silent_motion(JointSystem(one, other));
  if (motion.states.cols() == 0) return true;
  const Eigen::MatrixXd apart = motion.states.topRows(n) - motion.states.bottomRows(n);
  if ((apart * motion.reachable).norm() > kPairTolerance * 1e3) return false;
  // What is left once the reachable part, in which the states agree, is taken out.
  const Eigen::MatrixXd rest = complement(motion.reachable);
  const Eigen::MatrixXd dynamics = rest.transpose() * motion.dynamics * rest;
  const Eigen::MatrixXd seen =
      controllable(dynamics.transpose(), (apart * rest).transpose());  // moves the difference
  if (seen.cols() == 0) return true;
  const Eigen::MatrixXd moving = seen.transpose() * dynamics * seen;
  return Eigen::EigenSolver<Eigen::MatrixXd>(moving, false).eigenvalues().cwiseAbs().maxCoeff() <
         kStable;
}

}  // namespace holdfast
