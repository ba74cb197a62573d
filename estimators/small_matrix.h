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
/// kSmallSizeMax.
template <int Rows, int Columns = 1>
using Small =
    Eigen::Matrix<double, Rows, Columns,
                  Rows == 1 && Columns != 1 ? Eigen::RowMajor : static_cast<int>(Eigen::ColMajor),
                  small_bound(Rows), small_bound(Columns)>;

template <class Matrix>
void symmetrise_small(Matrix& matrix) {
  for (Eigen::Index j = 1; j < matrix.cols(); ++j) {
    for (Eigen::Index i = 0; i < j; ++i) {
      matrix(i, j) = matrix(j, i) = 0.5 * (matrix(i, j) + matrix(j, i));
    }
  }
}

/// S = L L', with the reciprocals of L's diagonal in place of its diagonal.
template <int Size>
class SmallCholesky {
 public:
  /// Reads the lower triangle; false when S is not positive definite or not finite.
  bool factorise(const Small<Size, Size>& S) {
    const Eigen::Index size = S.rows();
    factor_ = S;
    for (Eigen::Index j = 0; j < size; ++j) {
      for (Eigen::Index k = 0; k < j; ++k) {
        for (Eigen::Index i = j; i < size; ++i) factor_(i, j) -= factor_(i, k) * factor_(j, k);
      }
      const double pivot = factor_(j, j);
      if (!(pivot > 0.0 && pivot < kInfinity)) return false;
      const double reciprocal = 1.0 / std::sqrt(pivot);
      factor_(j, j) = reciprocal;
      for (Eigen::Index i = j + 1; i < size; ++i) factor_(i, j) *= reciprocal;
    }
    return true;
  }

  /// v = L^-1 v.
  void whiten(Small<Size>& v) const {
    for (Eigen::Index j = 0; j < v.size(); ++j) {
      v[j] *= factor_(j, j);
      for (Eigen::Index i = j + 1; i < v.size(); ++i) v[i] -= factor_(i, j) * v[j];
    }
  }

  /// M = M L'^-1, column by column.
  template <int Rows>
  void whiten_right(Small<Rows, Size>& M) const {
    for (Eigen::Index j = 0; j < M.cols(); ++j) {
      for (Eigen::Index k = 0; k < j; ++k) M.col(j) -= factor_(j, k) * M.col(k);
      M.col(j) *= factor_(j, j);
    }
  }

  /// M = M L^-1; after whiten_right, M S^-1.
  template <int Rows>
  void colour_right(Small<Rows, Size>& M) const {
    for (Eigen::Index j = M.cols() - 1; j >= 0; --j) {
      for (Eigen::Index k = M.cols() - 1; k > j; --k) M.col(j) -= factor_(k, j) * M.col(k);
      M.col(j) *= factor_(j, j);
    }
  }

  /// -log sqrt(det S).
  double log_density_factor() const {
    double sum = 0.0, product = 1.0;
    for (Eigen::Index j = 0; j < factor_.rows(); ++j) {
      product *= factor_(j, j);
      if (j % 4 != 3) continue;  // a product of four stays in range, and four logarithms cost time
      sum += std::log(product);
      product = 1.0;
    }
    return factor_.rows() % 4 == 0 ? sum : sum + std::log(product);
  }

 private:
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();

  Small<Size, Size> factor_;
};

}  // namespace holdfast
