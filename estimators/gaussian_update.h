#pragma once

#include <array>
#include <cstddef>

#include "estimators/small_factor.h"
#include "estimators/small_matrix.h"
#include "estimators/small_product.h"

namespace holdfast {

/// Mean [n] and covariance [n x n] of a belief; N may be Eigen::Dynamic.
template <int N>
struct Belief {
  Small<N> mean;
  Small<N, N> covariance;
};

/// What a belief on x says of h(x), before noise and attacks.
///
/// Symbols: h [l] mean, Phh [l x l] covariance, Pxh [n x l] covariance with x, J [l x n] Jacobian
/// or statistical regression, P J' = Pxh; Phh - J Pxh [l x l] what no regression explains.
template <int N, int L>
struct Observation {
  Small<L> h;
  Small<L, L> Phh;
  Small<N, L> Pxh;
  Small<L, N> J;
  bool has_jacobian = false;
  Small<L, L> unexplained;  // where h is not linear
  bool has_unexplained = false;

  // Rows of y that did not arrive: they teach nothing and count in no density.
  int num_missing = 0;
  std::array<bool, small_bound(L)> is_missing{};

  /// Takes a row out of h, Phh, Pxh, J and what is unexplained.
  void leave_out(Eigen::Index row) {
    ++num_missing;
    is_missing[static_cast<std::size_t>(row)] = true;
    h[row] = 0.0;
    Phh.row(row).setZero();
    Phh.col(row).setZero();
    Pxh.col(row).setZero();
    if (has_jacobian) J.row(row).setZero();
    if (!has_unexplained) return;
    unexplained.row(row).setZero();
    unexplained.col(row).setZero();
  }
  /// All rows are there again; must be followed by a new observation.
  void expect_all() {
    num_missing = 0;
    is_missing.fill(false);
  }
};

/// What is believed of a reading: y = c h(x) + e, e of any mean, Cov[e] = Omega not correlated with
/// x; E[y] = mean, Cov[y] = S = c^2 Phh + Omega, Cov[x, y] = c Pxh.
template <int L>
struct ReadingBelief {
  double c = 1.0;
  Small<L> mean;
  Small<L, L> S, Omega;
};

/// What a measurement update made of a reading.
struct UpdateResult {
  bool is_definite = false;  // S was positive definite; else the belief stands as it was
  double squared_distance = 0.0;
  double log_density = 0.0;
};

/// One step of x' = F x + w, w ~ N(0, Q): mean F m, covariance F P F' + Q. `cross` [n x n] becomes
/// Cov[x, x'] = P F', which the smoother needs. `next` may not be `belief`.
template <int N>
[[gnu::flatten]] void predict_linear(const Small<N, N>& F, const Small<N, N>& Q,
                                     const Belief<N>& belief, Small<N, N>& cross, Belief<N>& next) {
  multiply(F, belief.mean, next.mean);
  multiply_transposed(belief.covariance, F, cross);
  add_symmetric(Q, F, cross, next.covariance);
}

/// h(x) = H x.
template <int N, int L>
[[gnu::flatten]] void observe_linear(const Small<L, N>& H, const Belief<N>& belief,
                                     Observation<N, L>& observation) {
  multiply(H, belief.mean, observation.h);
  observation.J = H;
  observation.has_jacobian = true;
  observation.has_unexplained = false;
  multiply_transposed(belief.covariance, H, observation.Pxh);
  multiply_symmetric(H, observation.Pxh, observation.Phh);
}

/// A reading without attack: c = 1, Omega = R.
template <int N, int L>
[[gnu::flatten]] void believe_reading(const Observation<N, L>& observation, const Small<L, L>& R,
                                      ReadingBelief<L>& reading) {
  reading.c = 1.0;
  reading.mean = observation.h;
  reading.Omega = R;
  reading.S = observation.Phh + R;
}

/// Linear minimum-variance update of `prior` by y: gain K = c Pxh S^-1, mean m + K (y - E[y]).
/// Covariance in Joseph form, (I - K c J) P (I - K c J)' + K V K', V = Omega + c^2 (Phh - J Pxh),
/// where J is known; else P - K S K'. The former is formed as W + (K V - W c J') K' with
/// W = (I - K c J) P, so that what rounding leaves in W is multiplied by I - K c J, too.
template <int N, int L>
class GaussianUpdate {
 public:
  /// Weighs the innovation by S; missing rows count in nothing.
  [[gnu::flatten]] UpdateResult weigh(const Observation<N, L>& observation,
                                      const ReadingBelief<L>& reading, const Small<L>& y) {
    innovation_ = y - reading.mean;
    if (observation.num_missing == 0) return weigh(reading.S, 0);
    masked_ = reading.S;
    for (Eigen::Index i = 0; i < y.size(); ++i) {
      if (!observation.is_missing[static_cast<std::size_t>(i)]) continue;
      masked_.row(i).setZero();
      masked_.col(i).setZero();
      masked_(i, i) = 1.0;
      innovation_[i] = 0.0;
    }
    return weigh(masked_, observation.num_missing);
  }

  /// Of what was weighed last, with a definite S. `posterior` may be `prior`.
  [[gnu::flatten]] void apply(const Belief<N>& prior, const Observation<N, L>& observation,
                              const ReadingBelief<L>& reading, Belief<N>& posterior) {
    cross_ = reading.c * observation.Pxh;
    gain_ = cross_;
    if (observation.has_jacobian) {
      slope_ = reading.c * observation.J;
      factor_.solve_right(gain_);
      add_product(prior.mean, gain_, innovation_, posterior.mean);
      subtract_transposed_product(prior.covariance, gain_, cross_, kept_);
      if (observation.has_unexplained) {
        noise_ = reading.Omega + reading.c * reading.c * observation.unexplained;
        multiply(gain_, noise_, scaled_gain_);
      } else {
        multiply(gain_, reading.Omega, scaled_gain_);
      }
      subtract_transposed_product(scaled_gain_, kept_, slope_, scaled_gain_);
      add_transposed_symmetric(kept_, scaled_gain_, gain_, posterior.covariance);
    } else {
      factor_.forward_right(gain_);
      half_gain_ = gain_;
      factor_.scale_right(gain_);
      add_product(prior.mean, gain_, forwarded_, posterior.mean);
      scaled_gain_ = -gain_;
      add_transposed_symmetric(prior.covariance, scaled_gain_, half_gain_, posterior.covariance);
    }
  }

  /// Of what was weighed last: S = L D L', the density of another reading at that squared distance
  /// from E[y], and, after apply() with a Jacobian, the gain K.
  const SmallFactor<L>& factor() const { return factor_; }
  double log_density(double squared_distance) const {
    return log_density_factor_ - 0.5 * (squared_distance + num_rows_ * kLogTwoPi);
  }
  const Small<N, L>& gain() const { return gain_; }

 private:
  static constexpr double kLogTwoPi = 1.8378770664093454835606594728112;

  [[gnu::flatten]] UpdateResult weigh(const Small<L, L>& S, int num_missing) {
    UpdateResult result;
    forwarded_ = innovation_;
    if (!factor_.factorise(S, forwarded_)) return result;
    result.is_definite = true;
    // By scalars as they were written just now: vectors of them would wait for the memory.
    for (Eigen::Index i = 0; i < forwarded_.size(); ++i) {
      result.squared_distance += forwarded_[i] * forwarded_[i] * factor_.reciprocals()[i];
    }
    log_density_factor_ = factor_.log_density_factor();
    num_rows_ = static_cast<double>(S.rows() - num_missing);
    result.log_density = log_density(result.squared_distance);
    return result;
  }

  SmallFactor<L> factor_;
  double log_density_factor_ = 0.0, num_rows_ = 0.0;
  Small<L> innovation_, forwarded_;  // nu, L^-1 nu
  Small<L, L> masked_, noise_;
  Small<N, L> cross_, gain_, half_gain_, scaled_gain_;
  Small<L, N> slope_;
  Small<N, N> kept_;
};

}  // namespace holdfast
