#include "estimators/flat_signal_update.h"

#include <Eigen/QR>
#include <cmath>
#include <numbers>

#include "common/errors.h"

namespace holdfast {

FlatSignalUpdate::FlatSignalUpdate(const SystemModel& model, const std::vector<int>& rows,
                                   bool is_delayed)
    : C_(model.C(rows, Eigen::all)),
      H_(is_delayed ? Eigen::MatrixXd(C_ * model.G) : Eigen::MatrixXd(model.H(rows, Eigen::all))),
      R_(model.R(rows, rows)),
      signal_gain_(is_delayed ? model.G : Eigen::MatrixXd::Zero(model.G.rows(), model.G.cols())),
      x_(model.num_states()),
      a_(model.num_attack_channels()) {
  if (Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(H_).rank() < H_.cols()) {
    throw UsageError("input_prior: without a prior the measurement must show every channel (rank " +
                     std::string(is_delayed ? "C G" : "H") + " = number of channels)");
  }
  const Eigen::Index n = model.num_states(), m = model.num_attack_channels();
  transform_.setIdentity(n, n + m);
  transform_.rightCols(m) = -signal_gain_;
}

void FlatSignalUpdate::factorise(const GaussianMixture::ConstCovariance& P, Factor& factor) {
  const Eigen::Index n = C_.cols(), m = H_.cols(), l = C_.rows();
  // Undo what x owes to the signal; a direct component keeps its x.
  CP_.noalias() = transform_ * P;
  Px_.noalias() = CP_ * transform_.transpose();
  factor.V.noalias() = C_ * Px_;
  S_ = R_;
  S_.noalias() += factor.V * C_.transpose();
  factor.S.compute(S_);
  factor.E = H_;
  factor.is_valid = factor.S.info() == Eigen::Success;
  if (!factor.is_valid) return;
  factor.S.matrixL().solveInPlace(factor.V);
  factor.S.matrixL().solveInPlace(factor.E);
  lambda_.noalias() = factor.E.transpose() * factor.E;
  factor.lambda.compute(lambda_);
  factor.is_valid = factor.lambda.info() == Eigen::Success;
  if (!factor.is_valid) return;
  factor.G = factor.E.transpose();
  factor.lambda.matrixL().solveInPlace(factor.G);
  factor.log_norm = -0.5 * static_cast<double>(l - m) * std::log(2.0 * std::numbers::pi) -
                    factor.S.matrixLLT().diagonal().array().log().sum() -
                    factor.lambda.matrixLLT().diagonal().array().log().sum();

  Paa_.setIdentity(m, m);
  factor.lambda.solveInPlace(Paa_);
  explained_.noalias() = factor.G * factor.V;  // [m x n]
  factor.covariance.setZero(n + m, n + m);
  Px_.noalias() -= factor.V.transpose() * factor.V;
  Px_.noalias() += explained_.transpose() * explained_;
  factor.lambda.matrixU().solveInPlace(explained_);
  Pxa_ = -explained_.transpose();  // -V'E Lambda^-1
  factor.covariance.topLeftCorner(n, n) = Px_;
  factor.covariance.bottomRightCorner(m, m) = Paa_;
  factor.covariance.topRightCorner(n, m) = Pxa_;
  factor.covariance.topRightCorner(n, m).noalias() += signal_gain_ * Paa_;
  factor.covariance.topLeftCorner(n, n).noalias() += Pxa_ * signal_gain_.transpose();
  factor.covariance.topLeftCorner(n, n).noalias() +=
      signal_gain_ * factor.covariance.topRightCorner(n, m).transpose();
  factor.covariance.bottomLeftCorner(m, n) = factor.covariance.topRightCorner(n, m).transpose();
}

void FlatSignalUpdate::predict(const double* z, Eigen::Ref<Eigen::VectorXd> y) {
  const Eigen::Index n = C_.cols(), m = H_.cols();
  x_.noalias() = transform_ * Eigen::Map<const Eigen::VectorXd>(z, n + m);
  y.noalias() = C_ * x_;
}

void FlatSignalUpdate::project(const Factor& factor,
                               Eigen::Ref<GaussianMixture::RowMajor> residuals) {
  factor.S.matrixL().solveInPlace(residuals);
  // A matrix would take new memory whenever the number of columns changes.
  const auto size = static_cast<std::size_t>(H_.cols() * residuals.cols());
  if (projected_.size() < size) projected_.resize(size);
  Eigen::Map<Eigen::MatrixXd> projected(projected_.data(), H_.cols(), residuals.cols());
  projected.noalias() = factor.G * residuals;
  residuals.noalias() -= factor.G.transpose() * projected;
}

void FlatSignalUpdate::correct(const Factor& factor, const double* z, Eigen::VectorXd& residual,
                               double* corrected) {
  const Eigen::Index n = C_.cols(), m = H_.cols();
  factor.S.matrixL().solveInPlace(residual);
  a_.noalias() = factor.E.transpose() * residual;
  factor.lambda.solveInPlace(a_);
  residual.noalias() -= factor.E * a_;
  x_.noalias() = transform_ * Eigen::Map<const Eigen::VectorXd>(z, n + m);
  x_.noalias() += factor.V.transpose() * residual;
  x_.noalias() += signal_gain_ * a_;
  Eigen::Map<Eigen::VectorXd>(corrected, n) = x_;
  Eigen::Map<Eigen::VectorXd>(corrected + n, m) = a_;
}

}  // namespace holdfast
