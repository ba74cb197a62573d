#pragma once

#include <Eigen/Core>

namespace holdfast {

/// Largest number of rows that a Small matrix of Eigen::Dynamic size can have.
inline constexpr int kSmallSizeMax = 32;

constexpr int small_bound(int size) {
  return size == Eigen::Dynamic ? kSmallSizeMax : size;
}

/// A matrix that never allocates: its size is known when compiled, or Eigen::Dynamic and at most
/// kSmallSizeMax. Its products are those of small_product.h or lazyProduct(): what Eigen does for
/// large matrices costs more than it saves here.
template <int Rows, int Columns = 1>
using Small =
    Eigen::Matrix<double, Rows, Columns,
                  Rows == 1 && Columns != 1 ? Eigen::RowMajor : static_cast<int>(Eigen::ColMajor),
                  small_bound(Rows), small_bound(Columns)>;

/// Takes the lower triangle of a matrix, which only rounding makes differ, from the upper one.
template <class Matrix>
void symmetrise_small(Matrix& matrix) {
  for (Eigen::Index j = 1; j < matrix.cols(); ++j) {
    for (Eigen::Index i = 0; i < j; ++i) matrix(j, i) = matrix(i, j);
  }
}

}  // namespace holdfast
