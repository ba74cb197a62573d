#include "estimators/mode_decoupling.h"

#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <cmath>

namespace holdfast {
namespace {

constexpr double kRankTolerance = 1e-9;

using FullSvd = Eigen::JacobiSVD<Eigen::MatrixXd, Eigen::FullPivHouseholderQRPreconditioner>;

Eigen::Index rank_of(const Eigen::VectorXd& singular_values, double scale) {
  Eigen::Index rank = 0;
  while (rank < singular_values.size() && singular_values[rank] > kRankTolerance * scale) ++rank;
  return rank;
}

Eigen::MatrixXd take_rows(const Eigen::MatrixXd& matrix, std::span<const int> rows) {
  Eigen::MatrixXd result(static_cast<Eigen::Index>(rows.size()), matrix.cols());
  for (std::size_t i = 0; i < rows.size(); ++i)
    result.row(static_cast<Eigen::Index>(i)) = matrix.row(rows[i]);
  return result;
}

// U and V of H; without rows or columns there is nothing to split.
void split_inputs(const Eigen::MatrixXd& H, Eigen::MatrixXd& U1, DecoupledMode& mode) {
  Eigen::MatrixXd U = Eigen::MatrixXd::Identity(H.rows(), H.rows());
  Eigen::MatrixXd V = Eigen::MatrixXd::Identity(H.cols(), H.cols());
  Eigen::VectorXd sigma;
  Eigen::Index rank = 0;
  if (H.size() > 0 && !H.isZero(0.0)) {
    const FullSvd svd(H, Eigen::ComputeFullU | Eigen::ComputeFullV);
    sigma = svd.singularValues();
    rank = rank_of(sigma, sigma[0]);
    U = svd.matrixU();
    V = svd.matrixV();
  }
  U1 = U.leftCols(rank);
  mode.U2 = U.rightCols(H.rows() - rank);
  mode.V1 = V.leftCols(rank);
  mode.V2 = V.rightCols(H.cols() - rank);
  mode.M1 = Eigen::MatrixXd::Zero(rank, rank);
  mode.log_det_sigma = 0.0;
  for (Eigen::Index i = 0; i < rank; ++i) {
    mode.M1(i, i) = 1.0 / sigma[i];
    mode.log_det_sigma += std::log(sigma[i]);
  }
}

}  // namespace

DecoupledMode decouple(const SystemModel& model, std::span<const int> rows) {
  DecoupledMode mode;
  mode.rows.assign(rows.begin(), rows.end());
  mode.is_complete = static_cast<int>(rows.size()) == model.num_measurements();
  mode.A = model.A;
  mode.Q = model.Q;
  mode.B = model.num_inputs() > 0 ? model.B : Eigen::MatrixXd(model.A.rows(), 0);
  const Eigen::MatrixXd C = take_rows(model.C, rows), H = take_rows(model.H, rows);
  const Eigen::MatrixXd D = model.num_inputs() > 0
                                ? take_rows(model.D, rows)
                                : Eigen::MatrixXd(static_cast<Eigen::Index>(rows.size()), 0);
  const Eigen::MatrixXd R = take_rows(take_rows(model.R, rows).transpose(), rows);
  Eigen::MatrixXd U1;
  split_inputs(H, U1, mode);
  mode.T2 = mode.U2.transpose();
  mode.R2 = mode.T2 * R * mode.U2;
  mode.T1 = U1.transpose();
  if (mode.U2.cols() > 0) {
    mode.T1 -= U1.transpose() * R * mode.U2 * mode.R2.llt().solve(mode.T2);
  }
  mode.C1 = mode.T1 * C;
  mode.D1 = mode.T1 * D;
  mode.R1 = mode.T1 * R * mode.T1.transpose();
  mode.C2 = mode.T2 * C;
  mode.D2 = mode.T2 * D;
  mode.G1 = model.G * mode.V1;
  mode.G2 = model.G * mode.V2;
  const Eigen::MatrixXd G1M1 = mode.G1 * mode.M1;
  mode.Ah = mode.A - G1M1 * mode.C1;
  mode.E = G1M1 * mode.R1 * G1M1.transpose() + mode.Q;
  return mode;
}

ModeTransition make_transition(const DecoupledMode& from, const DecoupledMode& to) {
  ModeTransition transition;
  transition.from = &from;
  transition.to = &to;
  transition.F = to.C2 * from.G2;
  const Eigen::Index num_free = transition.F.rows(), num_hidden = transition.F.cols();
  Eigen::Index rank = 0;
  transition.N = Eigen::MatrixXd::Identity(num_free, num_free);
  if (transition.F.size() > 0) {
    const FullSvd svd(transition.F, Eigen::ComputeFullU | Eigen::ComputeFullV);
    rank = rank_of(svd.singularValues(), to.C2.norm() * from.G2.norm());
    transition.N = svd.matrixU().rightCols(num_free - rank);
  }
  transition.is_determined = rank == num_hidden && from.is_complete && to.is_complete;
  return transition;
}

std::vector<int> undetermined_inputs(const ModeTransition& transition) {
  std::vector<int> channels;
  const Eigen::Index num_hidden = transition.F.cols();
  if (num_hidden == 0) return channels;
  Eigen::MatrixXd null_space = Eigen::MatrixXd::Identity(num_hidden, num_hidden);
  if (transition.F.rows() > 0) {
    const FullSvd svd(transition.F, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Eigen::Index rank =
        rank_of(svd.singularValues(), transition.to->C2.norm() * transition.from->G2.norm());
    null_space = svd.matrixV().rightCols(num_hidden - rank);
  }
  const Eigen::MatrixXd by_channel = transition.from->V2 * null_space;
  for (Eigen::Index i = 0; i < by_channel.rows(); ++i) {
    if (by_channel.cols() > 0 && by_channel.row(i).norm() > 1e-6) {
      channels.push_back(static_cast<int>(i));
    }
  }
  return channels;
}

Eigen::VectorXd singular_values(const Eigen::MatrixXd& matrix) {
  // The preconditioner needs one of the unitary matrices; these matrices are small.
  return FullSvd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV).singularValues();
}

}  // namespace holdfast
