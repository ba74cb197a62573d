#pragma once

#include <Eigen/Core>
#include <cstring>

#include "estimators/small_matrix.h"

namespace holdfast {
namespace small_product_detail {

// Rows that are summed in registers by whole vectors; what Eigen does for other sizes costs more.
constexpr bool is_blocked(int rows) {
  return rows == 2 || (rows > 0 && rows % 4 == 0);
}

// Numbers that are added and multiplied at once, by one instruction or two. In place, since
// functions that return them differ between processors.
template <int Size>
struct Lanes {
  using Type [[gnu::vector_size(Size * sizeof(double))]] = double;

  static void load(const double* from, Type& to) { std::memcpy(&to, from, sizeof(to)); }
  static void store(const Type& from, double* to) { std::memcpy(to, &from, sizeof(from)); }
};

// A factor on the right, or its transpose: by elements as the product takes them, and as Eigen
// does.
template <class Matrix, bool kIsTransposed>
struct Right {
  static constexpr int kStride = Matrix::RowsAtCompileTime;
  const Matrix& matrix;

  double operator()(int k, int j) const {
    return matrix.data()[kIsTransposed ? k * kStride + j : j * kStride + k];
  }
  decltype(auto) expression() const {
    if constexpr (kIsTransposed) {
      return matrix.transpose();
    } else {
      return (matrix);
    }
  }
};

// kColumns columns of kVectors vectors of rows: sums of products, kept in registers.
template <int Size, int kColumns, int kVectors>
using Sums = typename Lanes<Size>::Type[kColumns][kVectors];

enum class Action { kSet, kAdd, kSubtract };

// sums(i, j) =, += or -= A(i, k) B(k, first_column + j), for one k.
template <int Rows, int Size, int kColumns, int kVectors, Action kAction, class Factor>
[[gnu::always_inline]] inline void add_outer(const double* A, const Factor& B, int k,
                                             int first_column,
                                             Sums<Size, kColumns, kVectors>& sums) {
#pragma GCC unroll 16
  for (int v = 0; v < kVectors; ++v) {
    typename Lanes<Size>::Type a;
    Lanes<Size>::load(A + k * Rows + v * Size, a);
#pragma GCC unroll 16
    for (int j = 0; j < kColumns; ++j) {
      const auto product = a * B(k, first_column + j);
      if constexpr (kAction == Action::kSet) sums[j][v] = product;
      if constexpr (kAction == Action::kAdd) sums[j][v] += product;
      if constexpr (kAction == Action::kSubtract) sums[j][v] -= product;
    }
  }
}

// sums(i, j) =, += or -= the sum over k < Inner of A(i, k) B(k, first_column + j). Few sums are
// taken by two chains, which wait less for each other; KalmanLanes repeats their order.
template <int Rows, int Size, int kColumns, int kVectors, int Inner, Action kAction, class Factor>
[[gnu::always_inline]] inline void add_products(const double* A, const Factor& B, int first_column,
                                                Sums<Size, kColumns, kVectors>& sums) {
  constexpr Action kNext = kAction == Action::kSet ? Action::kAdd : kAction;
  if constexpr (Inner % 2 == 0 && kColumns * kVectors <= 4) {
    Sums<Size, kColumns, kVectors> others;
    add_outer<Rows, Size, kColumns, kVectors, kAction>(A, B, 0, first_column, sums);
    add_outer<Rows, Size, kColumns, kVectors, Action::kSet>(A, B, 1, first_column, others);
#pragma GCC unroll 2
    for (int k = 2; k < Inner; k += 2) {
      add_outer<Rows, Size, kColumns, kVectors, kNext>(A, B, k, first_column, sums);
      add_outer<Rows, Size, kColumns, kVectors, Action::kAdd>(A, B, k + 1, first_column, others);
    }
#pragma GCC unroll 16
    for (int j = 0; j < kColumns; ++j) {
#pragma GCC unroll 16
      for (int v = 0; v < kVectors; ++v) {
        if constexpr (kAction == Action::kSubtract) {
          sums[j][v] -= others[j][v];
        } else {
          sums[j][v] += others[j][v];
        }
      }
    }
  } else {
    add_outer<Rows, Size, kColumns, kVectors, kAction>(A, B, 0, first_column, sums);
    for (int k = 1; k < Inner; ++k) {
      add_outer<Rows, Size, kColumns, kVectors, kNext>(A, B, k, first_column, sums);
    }
  }
}

template <int Rows, int Size, int kColumns, int kVectors>
[[gnu::always_inline]] inline void load_sums(const double* from, int first_column,
                                             Sums<Size, kColumns, kVectors>& sums) {
#pragma GCC unroll 16
  for (int j = 0; j < kColumns; ++j) {
#pragma GCC unroll 16
    for (int v = 0; v < kVectors; ++v) {
      Lanes<Size>::load(from + (first_column + j) * Rows + v * Size, sums[j][v]);
    }
  }
}

// Columns that are summed together: as many as leave their sums, and what they are made of, in
// sixteen registers of four numbers.
constexpr int strip_of(int columns, int vectors) {
  for (int strip = 4; strip > 1; --strip) {
    if (columns % strip == 0 && strip * vectors <= 9) return strip;
  }
  return 1;
}

template <int Rows, int Size, int kColumns, int kVectors>
[[gnu::always_inline]] inline void store_sums(const Sums<Size, kColumns, kVectors>& sums,
                                              int first_column, double* to) {
#pragma GCC unroll 16
  for (int j = 0; j < kColumns; ++j) {
#pragma GCC unroll 16
    for (int v = 0; v < kVectors; ++v) {
      Lanes<Size>::store(sums[j][v], to + (first_column + j) * Rows + v * Size);
    }
  }
}

template <int Rows, int Columns, int Inner, Action kAction, class Factor>
void multiply(const double* base, const double* A, const Factor& B, double* out) {
  constexpr int kSize = Rows == 2 ? 2 : 4, kVectors = Rows / kSize;
  constexpr int kStrip = strip_of(Columns, kVectors);
  for (int column = 0; column < Columns; column += kStrip) {
    Sums<kSize, kStrip, kVectors> sums;
    if constexpr (kAction != Action::kSet)
      load_sums<Rows, kSize, kStrip, kVectors>(base, column, sums);
    add_products<Rows, kSize, kStrip, kVectors, Inner, kAction>(A, B, column, sums);
    store_sums<Rows, kSize, kStrip, kVectors>(sums, column, out);
  }
}

using Four = Lanes<4>::Type;

[[gnu::always_inline]] inline void transpose(const Four (&from)[4], Four (&to)[4]) {
  const Four a = __builtin_shufflevector(from[0], from[1], 0, 4, 2, 6);
  const Four b = __builtin_shufflevector(from[0], from[1], 1, 5, 3, 7);
  const Four c = __builtin_shufflevector(from[2], from[3], 0, 4, 2, 6);
  const Four d = __builtin_shufflevector(from[2], from[3], 1, 5, 3, 7);
  to[0] = __builtin_shufflevector(a, c, 0, 1, 4, 5);
  to[1] = __builtin_shufflevector(b, d, 0, 1, 4, 5);
  to[2] = __builtin_shufflevector(a, c, 2, 3, 6, 7);
  to[3] = __builtin_shufflevector(b, d, 2, 3, 6, 7);
}

// Stores a block of four columns, the kColumn-th four, and rows, the kRow-th, of a symmetric matrix
// and its mirror image; on the diagonal the upper triangle is taken for both.
template <int Rows, int kRow, int kColumn>
[[gnu::always_inline]] inline void store_symmetric(Four (&block)[4], double* out) {
  Four mirrored[4];
  transpose(block, mirrored);
  if (kRow == kColumn) {
    block[0] = mirrored[0];
    block[1] = __builtin_shufflevector(block[1], mirrored[1], 0, 1, 6, 7);
    block[2] = __builtin_shufflevector(block[2], mirrored[2], 0, 1, 2, 7);
  }
#pragma GCC unroll 4
  for (int c = 0; c < 4; ++c) {
    Lanes<4>::store(block[c], out + (4 * kColumn + c) * Rows + 4 * kRow);
    if (kRow < kColumn) Lanes<4>::store(mirrored[c], out + (4 * kRow + c) * Rows + 4 * kColumn);
  }
}

// out = A B or base + A B: the block (kRow, kColumn), the one below it, and so on until the
// diagonal; then those of the next columns. Two blocks at once, if there are two.
template <int Rows, int kRow, int kColumn, int Inner, Action kAction, class Factor>
void multiply_blocks(const double* base, const double* A, const Factor& B, double* out) {
  constexpr int kBlocks = kRow < kColumn ? 2 : 1, kStart = 4 * kRow;
  Sums<4, 4, kBlocks> sums;
  if constexpr (kAction != Action::kSet)
    load_sums<Rows, 4, 4, kBlocks>(base + kStart, 4 * kColumn, sums);
  add_products<Rows, 4, 4, kBlocks, Inner, kAction>(A + kStart, B, 4 * kColumn, sums);
  Four block[4] = {sums[0][0], sums[1][0], sums[2][0], sums[3][0]};
  store_symmetric<Rows, kRow, kColumn>(block, out);
  if constexpr (kBlocks == 2) {
    Four below[4] = {sums[0][1], sums[1][1], sums[2][1], sums[3][1]};
    store_symmetric<Rows, kRow + 1, kColumn>(below, out);
  }
  if constexpr (kRow + kBlocks <= kColumn) {
    multiply_blocks<Rows, kRow + kBlocks, kColumn, Inner, kAction>(base, A, B, out);
  } else if constexpr (4 * (kColumn + 1) < Rows) {
    multiply_blocks<Rows, 0, kColumn + 1, Inner, kAction>(base, A, B, out);
  }
}

template <int Rows, int Inner, Action kAction, class Factor>
void multiply_symmetric(const double* base, const double* A, const Factor& B, double* out) {
  if constexpr (Rows == 2) {
    Sums<2, 2, 1> sums;
    if constexpr (kAction != Action::kSet) load_sums<2, 2, 2, 1>(base, 0, sums);
    add_products<2, 2, 2, 1, Inner, kAction>(A, B, 0, sums);
    Lanes<2>::store(__builtin_shufflevector(sums[0][0], sums[1][0], 0, 2), out);
    Lanes<2>::store(sums[1][0], out + 2);
  } else {
    multiply_blocks<Rows, 0, 0, Inner, kAction>(base, A, B, out);
  }
}

// What columns of a strip take from each other when it is solved for a unit lower triangular L, of
// which Factor gives L(j, k) for (k, j) forwards and L(k, j) backwards.
template <int Size, int kStrip, int kVectors, bool kIsForward, class Factor>
[[gnu::always_inline]] inline void solve_within(const Factor& L, int column,
                                                Sums<Size, kStrip, kVectors>& sums) {
#pragma GCC unroll 4
  for (int i = 1; i < kStrip; ++i) {
    const int j = kIsForward ? i : kStrip - 1 - i;
#pragma GCC unroll 4
    for (int n = 0; n < i; ++n) {
      const int k = kIsForward ? n : kStrip - 1 - n;
#pragma GCC unroll 16
      for (int v = 0; v < kVectors; ++v) sums[j][v] -= sums[k][v] * L(column + k, column + j);
    }
  }
}

// M L'^-1 (forwards) or M L^-1, in place: a few columns at once, in registers, first what other
// columns take from them and then what they take from each other.
template <int Rows, int Columns, bool kIsForward, class Factor>
void solve_right(const Factor& L, double* M) {
  constexpr int kSize = Rows == 2 ? 2 : 4, kVectors = Rows / kSize;
  constexpr int kStrip = strip_of(Columns, kVectors), kStrips = Columns / kStrip;
  for (int strip = 0; strip < kStrips; ++strip) {
    const int column = kStrip * (kIsForward ? strip : kStrips - 1 - strip);
    Sums<kSize, kStrip, kVectors> sums;
    load_sums<Rows, kSize, kStrip, kVectors>(M, column, sums);
    const int first = kIsForward ? 0 : column + kStrip, last = kIsForward ? column : Columns;
    for (int k = first; k < last; ++k) {
      add_outer<Rows, kSize, kStrip, kVectors, Action::kSubtract>(M, L, k, column, sums);
    }
    solve_within<kSize, kStrip, kVectors, kIsForward>(L, column, sums);
    store_sums<Rows, kSize, kStrip, kVectors>(sums, column, M);
  }
}

// All columns are one strip, so that they need not go to memory between forwards and backwards.
template <int Rows, int Columns>
inline constexpr bool kIsOneStrip = is_blocked(Rows) && Columns > 0 && Columns <= 4 &&
                                    strip_of(Columns, Rows == 2 ? 1 : Rows / 4) == Columns;

// M (L D L')^-1, in place, of one strip: lower(i, j) gives L(i, j), `reciprocals` the diagonal of
// D^-1.
template <int Rows, int Columns, class Lower>
void solve_strip(const Lower& lower, const double* reciprocals, double* M) {
  constexpr int kSize = Rows == 2 ? 2 : 4, kVectors = Rows / kSize;
  Sums<kSize, Columns, kVectors> sums;
  load_sums<Rows, kSize, Columns, kVectors>(M, 0, sums);
  solve_within<kSize, Columns, kVectors, true>([&](int k, int j) { return lower(j, k); }, 0, sums);
#pragma GCC unroll 4
  for (int j = 0; j < Columns; ++j) {
#pragma GCC unroll 16
    for (int v = 0; v < kVectors; ++v) sums[j][v] *= reciprocals[j];
  }
  solve_within<kSize, Columns, kVectors, false>(lower, 0, sums);
  store_sums<Rows, kSize, Columns, kVectors>(sums, 0, M);
}

// Rows and columns known, so that the product is summed in registers.
template <int Rows, int Inner, int Columns>
inline constexpr bool kIsBlocked = is_blocked(Rows) && Inner > 0 && Columns > 0;

template <int Rows, int Columns>
using Plain = Right<Small<Rows, Columns>, false>;
template <int Rows, int Columns>
using Transposed = Right<Small<Rows, Columns>, true>;

// out = A B, base + A B, or base - A B.
template <Action kAction, int Rows, int Inner, int Columns, class Factor>
void product(const Small<Rows, Columns>* base, const Small<Rows, Inner>& A, const Factor& B,
             Small<Rows, Columns>& out) {
  if constexpr (kIsBlocked<Rows, Inner, Columns>) {
    multiply<Rows, Columns, Inner, kAction>(kAction == Action::kSet ? nullptr : base->data(),
                                            A.data(), B, out.data());
  } else if constexpr (kAction == Action::kSet) {
    out = A.lazyProduct(B.expression());
  } else {
    out = *base;
    if constexpr (kAction == Action::kAdd) out += A.lazyProduct(B.expression());
    if constexpr (kAction == Action::kSubtract) out -= A.lazyProduct(B.expression());
  }
}

// The same where that is symmetric.
template <Action kAction, int Rows, int Inner, class Factor>
void symmetric_product(const Small<Rows, Rows>* base, const Small<Rows, Inner>& A, const Factor& B,
                       Small<Rows, Rows>& out) {
  if constexpr (kIsBlocked<Rows, Inner, Rows>) {
    multiply_symmetric<Rows, Inner, kAction>(kAction == Action::kSet ? nullptr : base->data(),
                                             A.data(), B, out.data());
  } else {
    product<kAction>(base, A, B, out);
    symmetrise_small(out);
  }
}

}  // namespace small_product_detail

/// out = A B. Where sizes are compiled and the rows of A are 2 or a multiple of 4, sums are kept in
/// registers, here as below. `out` may be none of the factors.
template <int Rows, int Inner, int Columns>
void multiply(const Small<Rows, Inner>& A, const Small<Inner, Columns>& B,
              Small<Rows, Columns>& out) {
  namespace detail = small_product_detail;
  detail::product<detail::Action::kSet, Rows, Inner, Columns>(
      nullptr, A, detail::Plain<Inner, Columns>{B}, out);
}

/// out = A B'.
template <int Rows, int Inner, int Columns>
void multiply_transposed(const Small<Rows, Inner>& A, const Small<Columns, Inner>& B,
                         Small<Rows, Columns>& out) {
  namespace detail = small_product_detail;
  detail::product<detail::Action::kSet, Rows, Inner, Columns>(
      nullptr, A, detail::Transposed<Columns, Inner>{B}, out);
}

/// out = base + A B; `base` may be `out`.
template <int Rows, int Inner, int Columns>
void add_product(const Small<Rows, Columns>& base, const Small<Rows, Inner>& A,
                 const Small<Inner, Columns>& B, Small<Rows, Columns>& out) {
  namespace detail = small_product_detail;
  detail::product<detail::Action::kAdd, Rows, Inner, Columns>(
      &base, A, detail::Plain<Inner, Columns>{B}, out);
}

/// out = base - A B'; `base` may be `out`.
template <int Rows, int Inner, int Columns>
void subtract_transposed_product(const Small<Rows, Columns>& base, const Small<Rows, Inner>& A,
                                 const Small<Columns, Inner>& B, Small<Rows, Columns>& out) {
  namespace detail = small_product_detail;
  detail::product<detail::Action::kSubtract, Rows, Inner, Columns>(
      &base, A, detail::Transposed<Columns, Inner>{B}, out);
}

/// out = A B where that is symmetric: its upper triangle stands for both, here as below.
template <int Rows, int Inner>
void multiply_symmetric(const Small<Rows, Inner>& A, const Small<Inner, Rows>& B,
                        Small<Rows, Rows>& out) {
  namespace detail = small_product_detail;
  detail::symmetric_product<detail::Action::kSet, Rows, Inner>(nullptr, A,
                                                               detail::Plain<Inner, Rows>{B}, out);
}

/// out = base + A B where that is symmetric; `base` may be `out`.
template <int Rows, int Inner>
void add_symmetric(const Small<Rows, Rows>& base, const Small<Rows, Inner>& A,
                   const Small<Inner, Rows>& B, Small<Rows, Rows>& out) {
  namespace detail = small_product_detail;
  detail::symmetric_product<detail::Action::kAdd, Rows, Inner>(&base, A,
                                                               detail::Plain<Inner, Rows>{B}, out);
}

/// out = base + A B' where that is symmetric; `base` may be `out`.
template <int Rows, int Inner>
void add_transposed_symmetric(const Small<Rows, Rows>& base, const Small<Rows, Inner>& A,
                              const Small<Rows, Inner>& B, Small<Rows, Rows>& out) {
  namespace detail = small_product_detail;
  detail::symmetric_product<detail::Action::kAdd, Rows, Inner>(
      &base, A, detail::Transposed<Rows, Inner>{B}, out);
}

}  // namespace holdfast
