#include "common/models/system_model.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>

namespace holdfast {
namespace {

std::string size_text(Eigen::Index rows, Eigen::Index columns) {
  return std::to_string(rows) + " x " + std::to_string(columns);
}

void check_size(const char* name, const Eigen::MatrixXd& matrix, Eigen::Index rows,
                Eigen::Index columns, std::vector<std::string>& problems) {
  if (matrix.rows() == rows && matrix.cols() == columns) return;
  problems.push_back(std::string(name) + " must be " + size_text(rows, columns) + ", not " +
                     size_text(matrix.rows(), matrix.cols()));
}

bool is_symmetric(const Eigen::MatrixXd& matrix) {
  return (matrix - matrix.transpose()).cwiseAbs().maxCoeff() <= 1e-9 * matrix.cwiseAbs().maxCoeff();
}

}  // namespace

void SystemModel::move(const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                       Eigen::VectorXd& next) const {
  if (transition) return transition(x, a, next);
  next.noalias() = A * x;
  if (a.size() > 0) next.noalias() += G * a;
}

void SystemModel::measure(const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                          Eigen::VectorXd& y) const {
  if (measurement) return measurement(x, a, y);
  y.noalias() = C * x;
  if (a.size() > 0) y.noalias() += H * a;
}

void SystemModel::move_jacobian(const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                                Eigen::MatrixXd& F) const {
  if (transition_jacobian) return transition_jacobian(x, a, F);
  F.leftCols(A.cols()) = A;
  F.rightCols(G.cols()) = G;
}

void SystemModel::measure_jacobian(const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                                   Eigen::MatrixXd& J) const {
  if (measurement_jacobian) return measurement_jacobian(x, a, J);
  J.leftCols(C.cols()) = C;
  J.rightCols(H.cols()) = H;
}

std::vector<std::string> SystemModel::problems() const {
  std::vector<std::string> problems;
  const Eigen::Index n = A.rows(), l = C.rows(), m = G.cols();
  check_size("A", A, n, n, problems);
  check_size("C", C, l, n, problems);
  check_size("G", G, n, m, problems);
  check_size("H", H, l, m, problems);
  check_size("Q", Q, n, n, problems);
  check_size("R", R, l, l, problems);
  if (B.size() > 0 || D.size() > 0) {
    check_size("B", B, n, B.cols(), problems);
    check_size("D", D, l, B.cols(), problems);
  }
  if (n == 0) problems.emplace_back("A must have at least one row");
  if (l == 0) problems.emplace_back("C must have at least one row");
  if (!problems.empty()) return problems;
  for (const auto& [name, matrix] :
       {std::pair{"A", &A}, std::pair{"C", &C}, std::pair{"G", &G}, std::pair{"H", &H},
        std::pair{"Q", &Q}, std::pair{"R", &R}, std::pair{"B", &B}, std::pair{"D", &D}}) {
    if (!matrix->allFinite()) problems.push_back(std::string(name) + " must be finite");
  }
  if (!problems.empty()) return problems;
  if (!is_symmetric(Q)) problems.emplace_back("Q must be symmetric");
  if (!is_symmetric(R)) problems.emplace_back("R must be symmetric");
  if (!problems.empty()) return problems;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(Q, Eigen::EigenvaluesOnly);
  if (eigen.eigenvalues().minCoeff() < -1e-12 * std::max(1e-300, Q.cwiseAbs().maxCoeff())) {
    problems.emplace_back("Q must be positive semidefinite");
  }
  if (Eigen::LLT<Eigen::MatrixXd>(R).info() != Eigen::Success) {
    problems.emplace_back("R must be positive definite");
  }
  return problems;
}

SystemModel SystemModel::with_attack_channels(const std::vector<int>& channels) const {
  SystemModel model = *this;
  const auto count = static_cast<Eigen::Index>(channels.size());
  model.G.resize(G.rows(), count);
  model.H.resize(H.rows(), count);
  model.attack_names.clear();
  for (Eigen::Index i = 0; i < count; ++i) {
    const int channel = channels[static_cast<std::size_t>(i)];
    model.G.col(i) = G.col(channel);
    model.H.col(i) = H.col(channel);
    if (!attack_names.empty()) {
      model.attack_names.push_back(attack_names[static_cast<std::size_t>(channel)]);
    }
  }
  if (is_linear() || count == num_attack_channels()) return model;
  // A nonlinear function takes all channels: those left out stay zero.
  const auto widen = [channels, m = num_attack_channels()](const Eigen::VectorXd& a) {
    Eigen::VectorXd whole = Eigen::VectorXd::Zero(m);
    for (std::size_t i = 0; i < channels.size(); ++i) {
      whole[channels[i]] = a[static_cast<Eigen::Index>(i)];
    }
    return whole;
  };
  const auto narrow = [widen](const Function& function) -> Function {
    if (!function) return {};
    return [function, widen](const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                             Eigen::VectorXd& result) { function(x, widen(a), result); };
  };
  const auto narrow_jacobian = [widen, channels](const Jacobian& jacobian) -> Jacobian {
    if (!jacobian) return {};
    return [jacobian, widen, channels](const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                                       Eigen::MatrixXd& result) {
      const Eigen::VectorXd whole_a = widen(a);
      Eigen::MatrixXd whole(result.rows(), x.size() + whole_a.size());
      jacobian(x, whole_a, whole);
      result.leftCols(x.size()) = whole.leftCols(x.size());
      for (std::size_t i = 0; i < channels.size(); ++i) {
        result.col(x.size() + static_cast<Eigen::Index>(i)) = whole.col(x.size() + channels[i]);
      }
    };
  };
  model.transition = narrow(transition);
  model.measurement = narrow(measurement);
  model.transition_jacobian = narrow_jacobian(transition_jacobian);
  model.measurement_jacobian = narrow_jacobian(measurement_jacobian);
  return model;
}

}  // namespace holdfast
