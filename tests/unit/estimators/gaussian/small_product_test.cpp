// Products and factors of small matrices: sizes of every path against Eigen's own.

#include "estimators/small_product.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <limits>

#include "common/random_stream.h"
#include "estimators/small_factor.h"
#include "estimators/small_matrix.h"

namespace holdfast {
namespace {

// Any size, or one that is compiled.
template <int Size, int OtherSize = Size>
struct Sizes {
  static constexpr int kRows = Size, kInner = OtherSize;
};

constexpr int actual(int size) {
  return size == Eigen::Dynamic ? 5 : size;
}

template <int Rows, int Columns>
Small<Rows, Columns> draw(std::uint32_t number) {
  const RandomStream stream(1, 0, "test/small");
  Small<Rows, Columns> matrix(actual(Rows), actual(Columns));
  for (Eigen::Index i = 0; i < matrix.size(); ++i) {
    matrix.data()[i] = stream.normal(number, static_cast<std::uint64_t>(i));
  }
  return matrix;
}

template <int Size>
Small<Size, Size> draw_definite(std::uint32_t number) {
  const Eigen::MatrixXd root = draw<Size, Size>(number);
  const auto n = root.rows();
  return Eigen::MatrixXd(root * root.transpose() + Eigen::MatrixXd::Identity(n, n));
}

bool is_near(const Eigen::MatrixXd& ours, const Eigen::MatrixXd& theirs, double tolerance = 1e-14) {
  return ours.allFinite() &&
         (ours - theirs).cwiseAbs().maxCoeff() <=
             tolerance * (1.0 + theirs.cwiseAbs().maxCoeff()) * static_cast<double>(ours.rows());
}

template <class Matrix>
bool is_symmetric(const Matrix& matrix) {
  return matrix == matrix.transpose();
}

}  // namespace

TEMPLATE_TEST_CASE("small products equal Eigen's", "", (Sizes<1, 1>), (Sizes<2, 2>), (Sizes<2, 4>),
                   (Sizes<2, 3>), (Sizes<3, 4>), (Sizes<4, 1>), (Sizes<4, 2>), (Sizes<4, 3>),
                   (Sizes<4, 4>), (Sizes<5, 2>), (Sizes<8, 4>), (Sizes<8, 5>), (Sizes<12, 12>),
                   (Sizes<12, 2>), (Sizes<16, 12>), (Sizes<20, 3>),
                   (Sizes<Eigen::Dynamic, Eigen::Dynamic>)) {
  constexpr int kRows = TestType::kRows, kInner = TestType::kInner;
  const auto A = draw<kRows, kInner>(1);
  const auto B = draw<kInner, kRows>(2);
  const auto C = draw<kRows, kInner>(3);
  const auto v = draw<kInner, 1>(4);
  const Small<kRows, kRows> base = draw<kRows, kRows>(5);
  const Eigen::MatrixXd A_(A), B_(B), C_(C), v_(v), base_(base);
  Small<kRows, kRows> square;
  Small<kRows> column;

  multiply(A, B, square);
  CHECK(is_near(square, A_ * B_));
  multiply(A, v, column);
  CHECK(is_near(column, A_ * v_));
  multiply_transposed(A, C, square);
  CHECK(is_near(square, A_ * C_.transpose()));
  add_product(base, A, B, square);
  CHECK(is_near(square, base_ + A_ * B_));
  subtract_transposed_product(base, A, C, square);
  CHECK(is_near(square, base_ - A_ * C_.transpose()));
  square = base;
  add_product(square, A, B, square);
  CHECK(is_near(square, base_ + A_ * B_));
  square = base;
  subtract_transposed_product(square, A, C, square);
  CHECK(is_near(square, base_ - A_ * C_.transpose()));
}

TEMPLATE_TEST_CASE("symmetric small products take the upper triangle for both", "", (Sizes<1, 1>),
                   (Sizes<2, 2>), (Sizes<2, 4>), (Sizes<3, 2>), (Sizes<4, 1>), (Sizes<4, 2>),
                   (Sizes<4, 4>), (Sizes<5, 2>), (Sizes<8, 4>), (Sizes<12, 12>), (Sizes<12, 3>),
                   (Sizes<16, 2>), (Sizes<20, 4>), (Sizes<Eigen::Dynamic, Eigen::Dynamic>)) {
  constexpr int kRows = TestType::kRows, kInner = TestType::kInner;
  // Not symmetric, so that it shows which triangle was taken.
  const auto A = draw<kRows, kInner>(1);
  const auto B = draw<kInner, kRows>(2);
  const auto C = draw<kRows, kInner>(3), D = draw<kRows, kInner>(4);
  const auto base = draw<kRows, kRows>(5);
  const Eigen::MatrixXd A_(A), B_(B), C_(C), D_(D), base_(base);
  const auto mirrored = [](const Eigen::MatrixXd& product) {
    return Eigen::MatrixXd(product.selfadjointView<Eigen::Upper>());
  };
  Small<kRows, kRows> out;

  multiply_symmetric(A, B, out);
  CHECK(is_symmetric(out));
  CHECK(is_near(out, mirrored(A_ * B_)));
  add_symmetric(base, A, B, out);
  CHECK(is_symmetric(out));
  CHECK(is_near(out, mirrored(base_ + A_ * B_)));
  add_transposed_symmetric(base, C, D, out);
  CHECK(is_symmetric(out));
  CHECK(is_near(out, mirrored(base_ + C_ * D_.transpose())));
  out = base;
  add_symmetric(out, A, B, out);
  CHECK(is_near(out, mirrored(base_ + A_ * B_)));
  out = base;
  add_transposed_symmetric(out, C, D, out);
  CHECK(is_near(out, mirrored(base_ + C_ * D_.transpose())));
}

TEMPLATE_TEST_CASE("a small factor solves as Eigen's does", "", (Sizes<2, 4>), (Sizes<3, 4>),
                   (Sizes<4, 4>), (Sizes<4, 3>), (Sizes<8, 2>), (Sizes<12, 12>), (Sizes<16, 12>),
                   (Sizes<Eigen::Dynamic, Eigen::Dynamic>)) {
  constexpr int kSize = TestType::kRows, kRows = TestType::kInner;
  for (std::uint32_t number = 0; number < 20; ++number) {
    const auto S = draw_definite<kSize>(number);
    SmallFactor<kSize> factor;
    REQUIRE(factor.factorise(S));
    const Eigen::MatrixXd inverse = Eigen::MatrixXd(S).inverse();

    // With a vector on its way, to the bit what comes of solving for it afterwards.
    const auto v = draw<kSize, 1>(200 + number);
    Small<kSize> along = v, afterwards = v;
    SmallFactor<kSize> other;
    REQUIRE(other.factorise(S, along));
    factor.forward(afterwards);
    CHECK(along == afterwards);
    const Eigen::MatrixXd lower = Eigen::MatrixXd(S).llt().matrixL();
    const Eigen::VectorXd roots = lower.diagonal();
    CHECK(is_near(Eigen::VectorXd(along).cwiseQuotient(roots),
                  lower.triangularView<Eigen::Lower>().solve(Eigen::VectorXd(v)), 1e-12));

    const auto M = draw<kRows, kSize>(100 + number);
    Small<kRows, kSize> solved = M;
    factor.solve_right(solved);
    CHECK(is_near(solved, Eigen::MatrixXd(M) * inverse, 1e-12));

    // M L'^-1 D^-1 (M L'^-1)', step by step: M S^-1 M' as the gain needs it.
    Small<kRows, kSize> half = M, scaled;
    factor.forward_right(half);
    scaled = half;
    factor.scale_right(scaled);
    CHECK(is_near(Eigen::MatrixXd(scaled) * Eigen::MatrixXd(half).transpose(),
                  Eigen::MatrixXd(M) * inverse * Eigen::MatrixXd(M).transpose(), 1e-12));

    Small<kSize, kSize> inverted;
    factor.invert(inverted);
    CHECK(is_near(inverted, inverse, 1e-12));
    const double log_determinant = 2.0 * roots.array().log().sum();
    CHECK(std::abs(factor.log_density_factor() + 0.5 * log_determinant) < 1e-12);
  }
}

TEMPLATE_TEST_CASE("a small factor refuses what is not positive definite", "", (Sizes<2>),
                   (Sizes<3>), (Sizes<4>), (Sizes<12>), (Sizes<Eigen::Dynamic>)) {
  constexpr int kSize = TestType::kRows;
  SmallFactor<kSize> factor;
  Small<kSize, kSize> S = draw_definite<kSize>(1);
  const Eigen::Index last = S.rows() - 1;
  for (const double bad : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity()}) {
    Small<kSize, kSize> spoilt = S;
    spoilt(last, last) = bad;
    CHECK_FALSE(factor.factorise(spoilt));
  }
  // What stands above the diagonal is never read.
  Small<kSize, kSize> upper = S;
  for (Eigen::Index j = 1; j <= last; ++j) {
    for (Eigen::Index i = 0; i < j; ++i) upper(i, j) = std::numeric_limits<double>::quiet_NaN();
  }
  REQUIRE(factor.factorise(upper));
  Small<kSize, kSize> inverse;
  factor.invert(inverse);
  CHECK(is_near(inverse, Eigen::MatrixXd(S).inverse(), 1e-12));
}

}  // namespace holdfast
