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

// sums(i, j) (+)= sum over k < Inner of A(i, k) B(k, first_column + j). Few sums are taken by two
// chains, which wait less for each other; KalmanLanes repeats their order.
template <int Rows, int Size, int kColumns, int kVectors, int Inner, bool kContinues, class Factor>
[[gnu::always_inline]] inline void add_products(const double* A, const Factor& B, int first_column,
                                                Sums<Size, kColumns, kVectors>& sums) {
  if constexpr (Inner % 2 == 0 && kColumns * kVectors <= 4) {
    Sums<Size, kColumns, kVectors> others;
    add_outer<Rows, Size, kColumns, kVectors, kContinues ? Action::kAdd : Action::kSet>(
        A, B, 0, first_column, sums);
    add_outer<Rows, Size, kColumns, kVectors, Action::kSet>(A, B, 1, first_column, others);
#pragma GCC unroll 2
    for (int k = 2; k < Inner; k += 2) {
      add_outer<Rows, Size, kColumns, kVectors, Action::kAdd>(A, B, k, first_column, sums);
      add_outer<Rows, Size, kColumns, kVectors, Action::kAdd>(A, B, k + 1, first_column, others);
    }
#pragma GCC unroll 16
    for (int j = 0; j < kColumns; ++j) {
#pragma GCC unroll 16
      for (int v = 0; v < kVectors; ++v) sums[j][v] += others[j][v];
    }
  } else {
    add_outer<Rows, Size, kColumns, kVectors, kContinues ? Action::kAdd : Action::kSet>(
        A, B, 0, first_column, sums);
    for (int k = 1; k < Inner; ++k) {
      add_outer<Rows, Size, kColumns, kVectors, Action::kAdd>(A, B, k, first_column, sums);
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

template <int Rows, int Columns, int Inner, bool kHasBase, class Factor>
void multiply(const double* base, const double* A, const Factor& B, double* out) {
  constexpr int kSize = Rows == 2 ? 2 : 4, kVectors = Rows / kSize;
  constexpr int kStrip = strip_of(Columns, kVectors);
  for (int column = 0; column < Columns; column += kStrip) {
    Sums<kSize, kStrip, kVectors> sums;
    if constexpr (kHasBase) load_sums<Rows, kSize, kStrip, kVectors>(base, column, sums);
    add_products<Rows, kSize, kStrip, kVectors, Inner, kHasBase>(A, B, column, sums);
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

// One product A B of a sum of products.
template <int Rows, int InnerSize, class Factor>
struct Term {
  static constexpr int kInner = InnerSize;
  const Small<Rows, InnerSize>& A;
  Factor B;
};

// out = base + the sum of the terms: the block (kRow, kColumn), the one below it, and so on until
// the diagonal; then those of the next columns. Two blocks at once, if there are two.
template <int Rows, int kRow, int kColumn, bool kHasBase, class First, class... Others>
void sum_blocks(const double* base, double* out, const First& first, const Others&... others) {
  constexpr int kBlocks = kRow < kColumn ? 2 : 1, kStart = 4 * kRow;
  Sums<4, 4, kBlocks> sums;
  if constexpr (kHasBase) load_sums<Rows, 4, 4, kBlocks>(base + kStart, 4 * kColumn, sums);
  add_products<Rows, 4, 4, kBlocks, First::kInner, kHasBase>(first.A.data() + kStart, first.B,
                                                             4 * kColumn, sums);
  (add_products<Rows, 4, 4, kBlocks, Others::kInner, true>(others.A.data() + kStart, others.B,
                                                           4 * kColumn, sums),
   ...);
  Four block[4] = {sums[0][0], sums[1][0], sums[2][0], sums[3][0]};
  store_symmetric<Rows, kRow, kColumn>(block, out);
  if constexpr (kBlocks == 2) {
    Four below[4] = {sums[0][1], sums[1][1], sums[2][1], sums[3][1]};
    store_symmetric<Rows, kRow + 1, kColumn>(below, out);
  }
  if constexpr (kRow + kBlocks <= kColumn) {
    sum_blocks<Rows, kRow + kBlocks, kColumn, kHasBase>(base, out, first, others...);
  } else if constexpr (4 * (kColumn + 1) < Rows) {
    sum_blocks<Rows, 0, kColumn + 1, kHasBase>(base, out, first, others...);
  }
}

template <int Rows, bool kHasBase, class First, class... Others>
void sum_symmetric(const double* base, double* out, const First& first, const Others&... others) {
  if constexpr (Rows == 2) {
    Sums<2, 2, 1> sums;
    if constexpr (kHasBase) load_sums<2, 2, 2, 1>(base, 0, sums);
    add_products<2, 2, 2, 1, First::kInner, kHasBase>(first.A.data(), first.B, 0, sums);
    (add_products<2, 2, 2, 1, Others::kInner, true>(others.A.data(), others.B, 0, sums), ...);
    Lanes<2>::store(__builtin_shufflevector(sums[0][0], sums[1][0], 0, 2), out);
    Lanes<2>::store(sums[1][0], out + 2);
  } else {
    sum_blocks<Rows, 0, 0, kHasBase>(base, out, first, others...);
  }
}

// M L'^-1 (forwards) or M L^-1, in place, for a unit lower triangular L, of which Factor gives L(j,
// k) for (k, j) forwards and L(k, j) backwards: a few columns at once, in registers, first what
// other columns take from them and then what they take from each other.
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
    store_sums<Rows, kSize, kStrip, kVectors>(sums, column, M);
  }
}

// Rows and columns known, so that the product is summed in registers.
template <int Rows, int Inner, int Columns>
inline constexpr bool kIsBlocked = is_blocked(Rows) && Inner > 0 && Columns > 0;

template <int Rows, int Columns>
using Plain = Right<Small<Rows, Columns>, false>;
template <int Rows, int Columns>
using Transposed = Right<Small<Rows, Columns>, true>;

// out = base + A B, or A B without a base.
template <bool kHasBase, int Rows, int Inner, int Columns, class Factor>
void product(const Small<Rows, Columns>* base, const Small<Rows, Inner>& A, const Factor& B,
             Small<Rows, Columns>& out) {
  if constexpr (kIsBlocked<Rows, Inner, Columns>) {
    multiply<Rows, Columns, Inner, kHasBase>(kHasBase ? base->data() : nullptr, A.data(), B,
                                             out.data());
  } else if constexpr (kHasBase) {
    out = *base;
    out += A.lazyProduct(B.expression());
  } else {
    out = A.lazyProduct(B.expression());
  }
}

// out = base + the sum of the terms, or that sum without a base, where it is symmetric.
template <bool kHasBase, int Rows, class First, class... Others>
void symmetric_sum(const Small<Rows, Rows>* base, Small<Rows, Rows>& out, const First& first,
                   const Others&... others) {
  if constexpr (is_blocked(Rows) && First::kInner > 0 && (true && ... && (Others::kInner > 0))) {
    sum_symmetric<Rows, kHasBase>(kHasBase ? base->data() : nullptr, out.data(), first, others...);
  } else {
    product<kHasBase>(base, first.A, first.B, out);
    (product<true>(&out, others.A, others.B, out), ...);
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
  detail::product<false, Rows, Inner, Columns>(nullptr, A, detail::Plain<Inner, Columns>{B}, out);
}

/// out = A B'.
template <int Rows, int Inner, int Columns>
void multiply_transposed(const Small<Rows, Inner>& A, const Small<Columns, Inner>& B,
                         Small<Rows, Columns>& out) {
  namespace detail = small_product_detail;
  detail::product<false, Rows, Inner, Columns>(nullptr, A, detail::Transposed<Columns, Inner>{B},
                                               out);
}

/// out = base + A B; `base` may be `out`.
template <int Rows, int Inner, int Columns>
void add_product(const Small<Rows, Columns>& base, const Small<Rows, Inner>& A,
                 const Small<Inner, Columns>& B, Small<Rows, Columns>& out) {
  namespace detail = small_product_detail;
  detail::product<true, Rows, Inner, Columns>(&base, A, detail::Plain<Inner, Columns>{B}, out);
}

/// out = base + A B'; `base` may be `out`.
template <int Rows, int Inner, int Columns>
void add_transposed_product(const Small<Rows, Columns>& base, const Small<Rows, Inner>& A,
                            const Small<Columns, Inner>& B, Small<Rows, Columns>& out) {
  namespace detail = small_product_detail;
  detail::product<true, Rows, Inner, Columns>(&base, A, detail::Transposed<Columns, Inner>{B}, out);
}

/// out = A B where that is symmetric: its upper triangle stands for both, here as below.
template <int Rows, int Inner>
void multiply_symmetric(const Small<Rows, Inner>& A, const Small<Inner, Rows>& B,
                        Small<Rows, Rows>& out) {
  namespace detail = small_product_detail;
  using Plain = detail::Plain<Inner, Rows>;
  detail::symmetric_sum<false, Rows>(nullptr, out, detail::Term<Rows, Inner, Plain>{A, {B}});
}

/// out = base + A B where that is symmetric; `base` may be `out`.
template <int Rows, int Inner>
void add_symmetric(const Small<Rows, Rows>& base, const Small<Rows, Inner>& A,
                   const Small<Inner, Rows>& B, Small<Rows, Rows>& out) {
  namespace detail = small_product_detail;
  using Plain = detail::Plain<Inner, Rows>;
  detail::symmetric_sum<true, Rows>(&base, out, detail::Term<Rows, Inner, Plain>{A, {B}});
}

/// out = base + A B' where that is symmetric; `base` may be `out`.
template <int Rows, int Inner>
void add_transposed_symmetric(const Small<Rows, Rows>& base, const Small<Rows, Inner>& A,
                              const Small<Rows, Inner>& B, Small<Rows, Rows>& out) {
  namespace detail = small_product_detail;
  using Transposed = detail::Transposed<Rows, Inner>;
  detail::symmetric_sum<true, Rows>(&base, out, detail::Term<Rows, Inner, Transposed>{A, {B}});
}

/// out = A B + C D' where that is symmetric; `out` may be none of the four.
template <int Rows, int Inner, int OtherInner>
void multiply_symmetric(const Small<Rows, Inner>& A, const Small<Inner, Rows>& B,
                        const Small<Rows, OtherInner>& C, const Small<Rows, OtherInner>& D,
                        Small<Rows, Rows>& out) {
  namespace detail = small_product_detail;
  using Plain = detail::Plain<Inner, Rows>;
  using Transposed = detail::Transposed<Rows, OtherInner>;
  detail::symmetric_sum<false, Rows>(nullptr, out, detail::Term<Rows, Inner, Plain>{A, {B}},
                                     detail::Term<Rows, OtherInner, Transposed>{C, {D}});
}

}  // namespace holdfast
