#pragma once

// Included by the SIMD kernels only; see particle_kernel_impl.h for why it sits in an unnamed
// namespace.

namespace holdfast {
namespace {

// cos and sin of 2 pi turns, turns in [0, 1]. The quarter turn is split off before the
// multiplication by pi / 2, which is exact, so one polynomial on [-pi/4, pi/4] serves each
// function; Taylor's terms left out are below 5e-17.
template <class Pack>
void unit_circle(typename Pack::V turns, typename Pack::V& cosine, typename Pack::V& sine) {
  using V = typename Pack::V;
  const V quarters = Pack::mul(turns, Pack::set(4.0));
  const V shifter = Pack::set(0x1.8p52);  // leaves the nearest integer in the low mantissa bits
  const V shifted = Pack::add(quarters, shifter);
  const V angle = Pack::mul(Pack::sub(quarters, Pack::sub(shifted, shifter)),
                            Pack::set(1.57079632679489661923));
  const V z = Pack::mul(angle, angle);
  constexpr double kSine[] = {
      -1.0 / 1307674368000.0, 1.0 / 6227020800.0, -1.0 / 39916800.0, 1.0 / 362880.0,
      -1.0 / 5040.0,          1.0 / 120.0,        -1.0 / 6.0};
  constexpr double kCosine[] = {
      1.0 / 20922789888000.0, -1.0 / 87178291200.0, 1.0 / 479001600.0, -1.0 / 3628800.0,
      1.0 / 40320.0,          -1.0 / 720.0,         1.0 / 24.0,        -0.5};
  V s = Pack::set(kSine[0]), c = Pack::set(kCosine[0]);
  for (int i = 1; i < 7; ++i) s = Pack::fma(s, z, Pack::set(kSine[i]));
  for (int i = 1; i < 8; ++i) c = Pack::fma(c, z, Pack::set(kCosine[i]));
  s = Pack::fma(Pack::mul(s, z), angle, angle);
  c = Pack::fma(c, z, Pack::set(1.0));
  const auto k = Pack::to_bits(shifted);
  const V is_odd = Pack::odd_mask(k);
  sine = Pack::flip_sign(Pack::select_negative(is_odd, c, s), Pack::sign_if_bit_1(k));
  cosine =
      Pack::flip_sign(Pack::select_negative(is_odd, s, c), Pack::sign_if_bit_1(Pack::add_one(k)));
}

}  // namespace
}  // namespace holdfast
