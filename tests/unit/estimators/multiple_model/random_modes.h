#pragma once

#include <string>

#include "common/models/system_model.h"
#include "common/random_stream.h"

namespace holdfast::testing {

/// Draws numbers of one test, one after the other.
class Draws {
 public:
  explicit Draws(const std::string& name) : stream_(1, 0, name) {}

  double normal() { return stream_.normal(1, next_++); }
  Eigen::VectorXd vector(Eigen::Index size) {
    return Eigen::VectorXd::NullaryExpr(size, [this](Eigen::Index) { return normal(); });
  }
  Eigen::MatrixXd matrix(Eigen::Index rows, Eigen::Index columns) {
    Eigen::MatrixXd result(rows, columns);
    for (Eigen::Index i = 0; i < rows; ++i) result.row(i) = vector(columns).transpose();
    return result;
  }
  Eigen::MatrixXd covariance(Eigen::Index size, double scale) {
    const Eigen::MatrixXd root = matrix(size, size);
    return scale * (root * root.transpose() + Eigen::MatrixXd::Identity(size, size));
  }

 private:
  RandomStream stream_;
  std::uint64_t next_ = 0;
};

/// A mode with p inputs of which H shows `rank`; the others act on the state alone.
inline SystemModel random_mode(Draws& draws, Eigen::Index n, Eigen::Index l, Eigen::Index p,
                               Eigen::Index rank, Eigen::Index num_known) {
  SystemModel model;
  model.A = 0.4 * draws.matrix(n, n);
  model.C = draws.matrix(l, n);
  model.G = draws.matrix(n, p);
  // Away from singular: through a small singular value the batch solution loses digits, too.
  const Eigen::MatrixXd left = draws.matrix(l, rank) + 2.0 * Eigen::MatrixXd::Identity(l, rank);
  const Eigen::MatrixXd right = draws.matrix(rank, p) + 2.0 * Eigen::MatrixXd::Identity(rank, p);
  model.H = rank == 0 ? Eigen::MatrixXd::Zero(l, p) : Eigen::MatrixXd(left * right);
  if (num_known > 0) {
    model.B = draws.matrix(n, num_known);
    model.D = draws.matrix(l, num_known);
  }
  model.Q = draws.covariance(n, 0.05);
  model.R = draws.covariance(l, 0.1);
  return model;
}

}  // namespace holdfast::testing
