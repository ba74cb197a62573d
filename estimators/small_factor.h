#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>

#include "estimators/small_product.h"

namespace holdfast {

/// S = L D L' with unit L and positive D: no square root stands in the way of a short step.
template <int Size>
class SmallFactor {
 public:
  /// Reads the lower triangle; false when S is not positive definite or not finite.
  bool factorise(const Small<Size, Size>& S) {
    return factorise(S, [](Eigen::Index /*j*/, Eigen::Index /*k*/, double /*factor*/) {});
  }
  /// And v = L^-1 v, in the time that divisions leave.
  bool factorise(const Small<Size, Size>& S, Small<Size>& v) {
    return factorise(
        S, [&v](Eigen::Index j, Eigen::Index k, double factor) { v[k] -= factor * v[j]; });
  }

  /// v = L^-1 v.
  void forward(Small<Size>& v) const {
    for (Eigen::Index j = 0; j + 1 < v.size(); ++j) {
      for (Eigen::Index i = j + 1; i < v.size(); ++i) v[i] -= L_(i, j) * v[j];
    }
  }
  /// M = M L'^-1.
  template <int Rows>
  void forward_right(Small<Rows, Size>& M) const {
    if constexpr (small_product_detail::kIsBlocked<Rows, 1, Size>) {
      small_product_detail::solve_right<Rows, Size, true>([this](int k, int j) { return L_(j, k); },
                                                          M.data());
    } else {
      for (Eigen::Index j = 1; j < M.cols(); ++j) {
        for (Eigen::Index k = 0; k < j; ++k) M.col(j) -= L_(j, k) * M.col(k);
      }
    }
  }
  /// M = M D^-1.
  template <int Rows>
  void scale_right(Small<Rows, Size>& M) const {
    for (Eigen::Index j = 0; j < M.cols(); ++j) M.col(j) *= reciprocals_[j];
  }
  /// M = M L^-1.
  template <int Rows>
  void backward_right(Small<Rows, Size>& M) const {
    if constexpr (small_product_detail::kIsBlocked<Rows, 1, Size>) {
      small_product_detail::solve_right<Rows, Size, false>(
          [this](int k, int j) { return L_(k, j); }, M.data());
    } else {
      for (Eigen::Index j = M.cols() - 2; j >= 0; --j) {
        for (Eigen::Index k = M.cols() - 1; k > j; --k) M.col(j) -= L_(k, j) * M.col(k);
      }
    }
  }
  /// M = M S^-1.
  template <int Rows>
  void solve_right(Small<Rows, Size>& M) const {
    if constexpr (small_product_detail::kIsOneStrip<Rows, Size>) {
      small_product_detail::solve_strip<Rows, Size>([this](int i, int j) { return L_(i, j); },
                                                    reciprocals_.data(), M.data());
    } else {
      forward_right(M);
      scale_right(M);
      backward_right(M);
    }
  }
  /// inverse = S^-1, for what is stored as a precision.
  void invert(Small<Size, Size>& inverse) const {
    inverse.setIdentity(L_.rows(), L_.cols());
    solve_right(inverse);
    symmetrise_small(inverse);
  }

  /// L(i, j) below the diagonal, i > j.
  double lower(Eigen::Index i, Eigen::Index j) const { return L_(i, j); }
  /// Diagonal of D^-1.
  const Small<Size>& reciprocals() const { return reciprocals_; }

  /// -log sqrt(det S).
  double log_density_factor() const {
    double sum = 0.0, product = 1.0;
    for (Eigen::Index j = 0; j < reciprocals_.size(); ++j) {
      product *= reciprocals_[j];
      if (j % 4 != 3) continue;  // a product of four stays in range, and four logarithms cost time
      sum += std::log(product);
      product = 1.0;
    }
    return 0.5 * (reciprocals_.size() % 4 == 0 ? sum : sum + std::log(product));
  }

 private:
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();
  static constexpr bool kHasFours = Size > 0 && Size % 4 == 0;

  template <class OnFactor>
  bool factorise(const Small<Size, Size>& S, const OnFactor& on_factor) {
    const Eigen::Index size = S.rows();
    L_ = S;
    reciprocals_.resize(size);
    for (Eigen::Index j = 0; j < size; ++j) {
      const double pivot = L_(j, j);
      if (!(pivot > 0.0 && pivot < kInfinity)) return false;
      const double reciprocal = 1.0 / pivot;
      reciprocals_[j] = reciprocal;
      for (Eigen::Index k = j + 1; k < size; ++k) {
        const double factor = L_(k, j) * reciprocal;
        subtract_below(first_row(k), factor, j, k);
        on_factor(j, k, factor);
      }
      scale_below(first_row(j + 1), reciprocal, j);
    }
    return true;
  }

  // Columns are worked on from a row or, where rows come in fours, from the four with it: what that
  // does above the diagonal is never read.
  static Eigen::Index first_row(Eigen::Index row) { return kHasFours ? row / 4 * 4 : row; }

  // L.col(k) -= factor L.col(j).
  void subtract_below(Eigen::Index row, double factor, Eigen::Index j, Eigen::Index k) {
    if constexpr (kHasFours) {
      for (; row < Size; row += 4) {
        L_.col(k).template segment<4>(row) -= factor * L_.col(j).template segment<4>(row);
      }
    } else {
      for (; row < L_.rows(); ++row) L_(row, k) -= L_(row, j) * factor;
    }
  }
  // L.col(j) *= factor.
  void scale_below(Eigen::Index row, double factor, Eigen::Index j) {
    if constexpr (kHasFours) {
      for (; row < Size; row += 4) L_.col(j).template segment<4>(row) *= factor;
    } else {
      for (; row < L_.rows(); ++row) L_(row, j) *= factor;
    }
  }

  Small<Size, Size> L_;
  Small<Size> reciprocals_;
};

}  // namespace holdfast
