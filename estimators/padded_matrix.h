#pragma once

#include <cmath>
#include <cstddef>
#include <cstring>

namespace holdfast::padded {

/// Small dense kernels on row-major matrices whose rows are padded with zeros to a multiple of four
/// numbers, so that every inner loop runs over whole vectors. `width` is a padded row length.

inline constexpr int width_of(int columns) {
  return (columns + 3) / 4 * 4;
}

namespace detail {

// Four numbers that are added and multiplied at once, by one instruction or two; spelled out since
// compilers vectorise the loop over k instead.
using Four [[gnu::vector_size(32)]] = double;

template <int kFours>
inline void add_block(double sign, const double* coefficients, std::ptrdiff_t stride, int count,
                      const double* rows, std::ptrdiff_t rows_width, double* row) {
  Four sum[kFours];
  for (int i = 0; i < kFours; ++i) std::memcpy(&sum[i], row + 4 * i, sizeof(Four));
  for (int k = 0; k < count; ++k) {
    const double factor = sign * coefficients[k * stride];
    const double* const other = rows + k * rows_width;
    for (int i = 0; i < kFours; ++i) {
      Four value;
      std::memcpy(&value, other + 4 * i, sizeof(Four));
      sum[i] += factor * value;
    }
  }
  for (int i = 0; i < kFours; ++i) std::memcpy(row + 4 * i, &sum[i], sizeof(Four));
}

}  // namespace detail

/// row += sign * sum over k < count of coefficients[k * stride] * rows[k].
inline void add_combination(double sign, const double* coefficients, int stride, int count,
                            const double* rows, int rows_width, double* row, int width) {
  while (width >= 12) {
    detail::add_block<3>(sign, coefficients, stride, count, rows, rows_width, row);
    width -= 12, rows += 12, row += 12;
  }
  if (width == 8) detail::add_block<2>(sign, coefficients, stride, count, rows, rows_width, row);
  if (width == 4) detail::add_block<1>(sign, coefficients, stride, count, rows, rows_width, row);
}

/// row += factor * other.
inline void add_row(double factor, const double* other, double* row, int width) {
  const double one = 1.0;
  add_combination(factor, &one, 1, 1, other, width, row, width);
}

/// out = A B: A [rows x inner], B [inner x columns of width].
inline void multiply(const double* A, int A_width, int rows, int inner, const double* B, int width,
                     double* out) {
  for (int i = 0; i < rows; ++i) {
    double* const row = out + i * width;
    for (int j = 0; j < width; ++j) row[j] = 0.0;
    add_combination(1.0, A + i * A_width, 1, inner, B, width, row, width);
  }
}

/// The same where out is square and symmetric: only what is on and above the diagonal is valid.
inline void multiply_upper(const double* A, int A_width, int size, int inner, const double* B,
                           int B_width, double* out, int width) {
  for (int i = 0; i < size; ++i) {
    const int start = i / 4 * 4;
    double* const row = out + i * width;
    for (int j = 0; j < width; ++j) row[j] = 0.0;
    add_combination(1.0, A + i * A_width, 1, inner, B + start, B_width, row + start, width - start);
  }
}

/// What a pivot that is not positive means: an error, or, where it is rounding about zero, a
/// direction without variance whose row of U and reciprocal become zero.
enum class Pivots { kPositive, kNonNegative };

/// Upper factor in place: S = U'U, [size x size], only the upper triangle is read and valid after.
/// reciprocals: 1 / U_ii. False when a pivot is not as wanted.
inline bool factorise(double* S, int width, int size, double* reciprocals, Pivots pivots) {
  for (int i = 0; i < size; ++i) {
    const int start = i / 4 * 4;
    double* const row = S + i * width;
    const double before = row[i];
    add_combination(-1.0, S + i, width, i, S + start, width, row + start, width - start);
    const double pivot = row[i];
    if (pivots == Pivots::kNonNegative && pivot <= 1e-13 * before) {
      if (!(pivot >= -1e-9 * before)) return false;
      for (int j = start; j < width; ++j) row[j] = 0.0;
      reciprocals[i] = 0.0;
      continue;
    }
    if (!(pivot > 0.0) || !std::isfinite(pivot)) return false;
    reciprocals[i] = 1.0 / std::sqrt(pivot);
    for (int j = start; j < width; ++j) row[j] *= reciprocals[i];
  }
  return true;
}

/// X := U'^-1 X in place, X [size x columns of X_width].
inline void solve_transposed(const double* U, int width, int size, const double* reciprocals,
                             double* X, int X_width) {
  for (int i = 0; i < size; ++i) {
    double* const row = X + i * X_width;
    add_combination(-1.0, U + i, width, i, X, X_width, row, X_width);
    for (int j = 0; j < X_width; ++j) row[j] *= reciprocals[i];
  }
}

/// x := U'^-1 x for one vector.
inline void solve_transposed(const double* U, int width, int size, const double* reciprocals,
                             double* x) {
  for (int i = 0; i < size; ++i) {
    x[i] *= reciprocals[i];
    const double* const row = U + i * width;
    for (int j = i + 1; j < size; ++j) x[j] -= row[j] * x[i];
  }
}

/// P -= W'W: W [rows x columns of width], P [size x columns of width]; symmetric stays symmetric.
inline void subtract_gram(const double* W, int rows, int width, double* P, int size) {
  for (int i = 0; i < size; ++i) {
    add_combination(-1.0, W + i, width, rows, W, width, P + i * width, width);
  }
}

/// Copies the upper triangle below the diagonal.
inline void mirror_upper(double* P, int width, int size) {
  for (int i = 1; i < size; ++i) {
    for (int j = 0; j < i; ++j) P[i * width + j] = P[j * width + i];
  }
}

}  // namespace holdfast::padded
