#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>

namespace holdfast {

/// Largest number of rows that a Small matrix of Eigen::Dynamic size can have.
inline constexpr int kSmallSizeMax = 32;

constexpr int small_bound(int size) {
  return size == Eigen::Dynamic ? kSmallSizeMax : size;
}

/// A matrix that never allocates: its size is known when compiled, or Eigen::Dynamic and at most
/// kSmallSizeMax. Its products are taken by lazyProduct(): what Eigen does for large matrices costs
/// more than it saves here.
template <int Rows, int Columns = 1>
using Small =
    Eigen::Matrix<double, Rows, Columns,
                  Rows == 1 && Columns != 1 ? Eigen::RowMajor : static_cast<int>(Eigen::ColMajor),
                  small_bound(Rows), small_bound(Columns)>;

/// Takes the upper triangle of a matrix, which only rounding makes differ, from the lower one.
template <class Matrix>
void symmetrise_small(Matrix& matrix) {
  for (Eigen::Index j = 1; j < matrix.cols(); ++j) {
    for (Eigen::Index i = 0; i < j; ++i) matrix(i, j) = matrix(j, i);
  }
}

/// S = L D L' with unit L and positive D: no square root stands in the way of a short step.
template <int Size>
class SmallFactor {
 public:
  /// Reads the lower triangle; false when S is not positive definite or not finite.
  bool factorise(const Small<Size, Size>& S) {
    const Eigen::Index size = S.rows();
    L_ = S;
    reciprocals_.resize(size);
    for (Eigen::Index j = 0; j < size; ++j) {
      const double pivot = L_(j, j);
      if (!(pivot > 0.0 && pivot < kInfinity)) return false;
      const double reciprocal = 1.0 / pivot;
      reciprocals_[j] = reciprocal;
      for (Eigen::Index k = j + 1; k < size; ++k) {
        const double scaled = L_(k, j) * reciprocal;
        for (Eigen::Index i = k; i < size; ++i) L_(i, k) -= L_(i, j) * scaled;
      }
      for (Eigen::Index i = j + 1; i < size; ++i) L_(i, j) *= reciprocal;
    }
    return true;
  }

  /// v = L^-1 v.
  void forward(Small<Size>& v) const {
    for (Eigen::Index j = 0; j + 1 < v.size(); ++j) {
      for (Eigen::Index i = j + 1; i < v.size(); ++i) v[i] -= L_(i, j) * v[j];
    }
  }
  /// M = M L'^-1, column by column.
  template <int Rows>
  void forward_right(Small<Rows, Size>& M) const {
    for (Eigen::Index j = 1; j < M.cols(); ++j) {
      for (Eigen::Index k = 0; k < j; ++k) M.col(j) -= L_(j, k) * M.col(k);
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
    for (Eigen::Index j = M.cols() - 2; j >= 0; --j) {
      for (Eigen::Index k = M.cols() - 1; k > j; --k) M.col(j) -= L_(k, j) * M.col(k);
    }
  }
  /// M = M S^-1.
  template <int Rows>
  void solve_right(Small<Rows, Size>& M) const {
    forward_right(M);
    scale_right(M);
    backward_right(M);
  }
  /// inverse = S^-1, for what is stored as a precision.
  void invert(Small<Size, Size>& inverse) const {
    inverse.setIdentity(L_.rows(), L_.cols());
    solve_right(inverse);
    symmetrise_small(inverse);
  }

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

  Small<Size, Size> L_;
  Small<Size> reciprocals_;
};

}  // namespace holdfast
