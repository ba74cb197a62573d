#pragma once

#include <cmath>
#include <numbers>

#include "estimators/mode_decoupling.h"
#include "estimators/small_factor.h"
#include "estimators/small_matrix.h"

namespace holdfast {

/// Which density of the decoupled output weighs a mode (method page, section 1 and pitfall 5).
enum class InputLikelihood {
  kPaper,    // of Gamma nu with orthonormal rows of Gamma that span range R2*
  kOrtho,    // of N' r, N an orthonormal basis of null(F')
  kFlat,     // of y with d integrated over a flat prior: units do not matter
  kEvidence  // kFlat with a Gaussian prior of each input: modes may differ in number of inputs
};

using AnyVector = Small<Eigen::Dynamic>;
using AnyMatrix = Small<Eigen::Dynamic, Eigen::Dynamic>;

/// What the filter of one mode knows after a step, but for the means.
struct InputStateCovariances {
  AnyMatrix P;    // of the state, [n x n]
  AnyMatrix Pd1;  // of the inputs that the output shows at once, [pH x pH]
};

/// Everything of a step that no reading changes. Symbols: those of DecoupledMode and
/// ModeTransition; r = z2 - C2 x_pred - D2 u the innovation of the free output, S its covariance.
struct InputStateGains {
  AnyMatrix Kx;  // x = x_pred + Kx r
  AnyMatrix M2;  // d2 of the step before = M2 r
  AnyMatrix W;   // nu' R2*^+ nu = r' W r
  AnyMatrix S;
  AnyMatrix J;   // what r adds to d1 of the step before, when that is to be improved
  AnyMatrix Pd;  // covariance of d of the step before, by channel
  double log_constant = 0.0;
  InputStateCovariances after;
};

/// How to make gains.
struct InputStateRule {
  InputLikelihood likelihood = InputLikelihood::kPaper;
  double input_std = 1e4;  // prior of inputs that the readings do not determine, and of kEvidence
  bool improves_input = false;  // with one more reading (erratum 12)
};

/// Covariance of the inputs seen at once, Algorithm 1, line 18.
inline void set_seen_input_covariance(const DecoupledMode& mode, InputStateCovariances& after) {
  const AnyMatrix C1P = mode.C1.lazyProduct(after.P);
  after.Pd1 = mode.R1;
  after.Pd1.noalias() += C1P.lazyProduct(mode.C1.transpose());
  for (Eigen::Index i = 0; i < after.Pd1.rows(); ++i) {
    for (Eigen::Index j = 0; j < after.Pd1.cols(); ++j) {
      after.Pd1(i, j) *= mode.M1(i, i) * mode.M1(j, j);
    }
  }
  symmetrise_small(after.Pd1);
}

/// Gains of one step in the sizes of the state and of the free output, Algorithm 1 in the form
/// without pseudo-inverse (method page, section 1). Where the transition is not determined, hidden
/// inputs have the prior N(0, input_std^2), and the density is the evidence.
template <int N, int M>
class InputStateStep {
 public:
  /// False when S or the information on hidden inputs is not positive definite; what `gains` holds
  /// is worth nothing then.
  bool run(const ModeTransition& transition, const InputStateRule& rule,
           const InputStateCovariances& before, InputStateGains& gains) {
    const DecoupledMode &from = *transition.from, &to = *transition.to;
    Ah_ = from.Ah;
    C2_ = to.C2;
    R2_ = to.R2;
    P_ = before.P;
    half_.noalias() = Ah_.lazyProduct(P_);
    Pt_ = from.E;
    Pt_.noalias() += half_.lazyProduct(Ah_.transpose());
    const bool has_prior = !transition.is_determined;
    if (has_prior && from.num_hidden() > 0) {
      const AnyMatrix spread = rule.input_std * from.G2;
      Pt_.noalias() += spread.lazyProduct(spread.transpose());
    }
    symmetrise_small(Pt_);
    PC_.noalias() = Pt_.lazyProduct(C2_.transpose());
    S_ = R2_;
    S_.noalias() += C2_.lazyProduct(PC_);
    symmetrise_small(S_);
    if (!factor_.factorise(S_)) return false;
    K_ = PC_;
    factor_.solve_right(K_);
    factor_.invert(W_);
    double log_constant = factor_.log_density_factor();
    if (has_prior) {
      estimate_hidden_by_prior(transition, rule, gains);
      log_constant += -to.log_det_sigma -
                      to.num_seen() * std::log(std::sqrt(2.0 * std::numbers::pi) * rule.input_std);
      log_constant -= 0.5 * static_cast<double>(S_.rows()) * kLogTwoPi;
    } else {
      if (!estimate_hidden(transition, rule.likelihood, gains, log_constant)) return false;
      log_constant -= 0.5 * static_cast<double>(transition.N.cols()) * kLogTwoPi;
      if (rule.likelihood == InputLikelihood::kFlat ||
          rule.likelihood == InputLikelihood::kEvidence) {
        log_constant -= to.log_det_sigma;
      }
      if (rule.likelihood == InputLikelihood::kEvidence) {
        log_constant -= (to.num_seen() + from.num_hidden()) *
                        std::log(std::sqrt(2.0 * std::numbers::pi) * rule.input_std);
      }
    }
    // Joseph form: any gain gives a covariance that stays symmetric and positive.
    rest_.setIdentity(P_.rows(), P_.cols());
    rest_.noalias() -= K_.lazyProduct(C2_);
    half_.noalias() = rest_.lazyProduct(Pt_);
    P_.noalias() = half_.lazyProduct(rest_.transpose());
    PC_.noalias() = K_.lazyProduct(R2_);
    P_.noalias() += PC_.lazyProduct(K_.transpose());
    symmetrise_small(P_);

    gains.log_constant = log_constant;
    gains.Kx = K_;
    gains.W = W_;
    gains.S = S_;
    set_input_covariance(transition, rule, before, gains);
    gains.after.P = P_;
    set_seen_input_covariance(to, gains.after);
    return true;
  }

 private:
  static constexpr double kLogTwoPi = 1.8378770664093454836;

  // Lines 5 and 6, and what they do to the gain: K_ becomes Kx, W_ what weighs nu.
  bool estimate_hidden(const ModeTransition& transition, InputLikelihood likelihood,
                       InputStateGains& gains, double& log_constant) {
    const Eigen::Index num_hidden = transition.F.cols();
    if (num_hidden == 0) {
      gains.M2.resize(0, S_.rows());
      Pd2_.resize(0, 0);
      return true;
    }
    const AnyMatrix F = transition.F;
    AnyMatrix& FS = FS_;  // F' S^-1
    FS = F.transpose().lazyProduct(W_);
    AnyMatrix information = FS.lazyProduct(F);
    symmetrise_small(information);
    if (!hidden_factor_.factorise(information)) return false;
    hidden_factor_.invert(Pd2_);
    gains.M2 = Pd2_.lazyProduct(FS);
    const AnyMatrix KF = K_.lazyProduct(F);
    const AnyMatrix more = transition.from->G2 - KF;
    K_.noalias() += more.lazyProduct(gains.M2);
    if (likelihood == InputLikelihood::kFlat || likelihood == InputLikelihood::kEvidence) {
      log_constant += hidden_factor_.log_density_factor();
    } else {
      log_constant = log_density_on_null_space(transition.N, likelihood);
    }
    W_.noalias() -= FS.transpose().lazyProduct(gains.M2);
    symmetrise_small(W_);
    return true;
  }

  // With d2 ~ N(0, s^2 I) the gain is the Kalman filter's, and so is the estimate of d2.
  void estimate_hidden_by_prior(const ModeTransition& transition, const InputStateRule& rule,
                                InputStateGains& gains) {
    const Eigen::Index num_hidden = transition.F.cols();
    const double variance = rule.input_std * rule.input_std;
    const AnyMatrix F = transition.F;
    const AnyMatrix FS = F.transpose().lazyProduct(W_);
    gains.M2 = variance * FS;
    Pd2_ = AnyMatrix::Identity(num_hidden, num_hidden) * variance;
    Pd2_.noalias() -= (variance * gains.M2).lazyProduct(F);
    symmetrise_small(Pd2_);
  }

  double log_density_on_null_space(const Eigen::MatrixXd& null_basis, InputLikelihood likelihood) {
    if (null_basis.cols() == 0) return 0.0;
    const AnyMatrix basis = null_basis;
    const AnyMatrix SN = S_.lazyProduct(basis);
    AnyMatrix inner = basis.transpose().lazyProduct(SN);
    symmetrise_small(inner);
    if (!null_factor_.factorise(inner)) return -kInfinity;
    const double ortho = null_factor_.log_density_factor();
    if (likelihood == InputLikelihood::kOrtho) return ortho;
    inner = SN.transpose().lazyProduct(SN);
    symmetrise_small(inner);
    if (!null_factor_.factorise(inner)) return -kInfinity;
    return null_factor_.log_density_factor() - ortho;
  }

  // Lines 10 and 11: of the inputs of the step before, by channel.
  void set_input_covariance(const ModeTransition& transition, const InputStateRule& rule,
                            const InputStateCovariances& before, InputStateGains& gains) {
    const DecoupledMode& from = *transition.from;
    const Eigen::Index seen = from.num_seen(), hidden = from.num_hidden();
    gains.J.resize(seen, S_.rows());
    gains.J.setZero();
    inner_.resize(seen + hidden, seen + hidden);
    inner_.topLeftCorner(seen, seen) = before.Pd1;
    inner_.bottomRightCorner(hidden, hidden) = Pd2_;
    if (seen > 0) {
      const AnyMatrix C1P = from.C1.lazyProduct(before.P);
      const AnyMatrix M1C1P = from.M1.diagonal().asDiagonal() * C1P;
      // How the errors of d1 and of x_pred go together, and so those of d1 and r.
      AnyMatrix cross = M1C1P.lazyProduct(from.A.transpose());
      cross.noalias() -= before.Pd1.lazyProduct(from.G1.transpose());
      const AnyMatrix with_r = cross.lazyProduct(C2_.transpose());
      inner_.topRightCorner(seen, hidden) = with_r.lazyProduct(gains.M2.transpose());
      inner_.bottomLeftCorner(hidden, seen) = inner_.topRightCorner(seen, hidden).transpose();
      if (rule.improves_input) {
        gains.J = -with_r.lazyProduct(W_);
        inner_.topLeftCorner(seen, seen) += gains.J.lazyProduct(with_r.transpose());
      }
    }
    V_.resize(from.num_inputs(), seen + hidden);
    V_.leftCols(seen) = from.V1;
    V_.rightCols(hidden) = from.V2;
    const AnyMatrix VP = V_.lazyProduct(inner_);
    gains.Pd = VP.lazyProduct(V_.transpose());
    symmetrise_small(gains.Pd);
  }

  static constexpr double kInfinity = std::numeric_limits<double>::infinity();

  Small<N, N> Ah_, P_, Pt_, half_, rest_;
  Small<M, N> C2_;
  Small<M, M> R2_, S_, W_;
  Small<N, M> PC_, K_;
  SmallFactor<M> factor_;
  SmallFactor<Eigen::Dynamic> hidden_factor_, null_factor_;
  AnyMatrix FS_, Pd2_, inner_, V_;
};

}  // namespace holdfast
