// Compiled with -mavx2 -mfma, used only where the processor has both.

#include <immintrin.h>

#include "estimators/particle_circle_impl.h"
#include "estimators/particle_kernel_impl.h"

// glibc's vector mathematics (libmvec), by the names of the x86-64 vector function ABI: the headers
// offer them only to -ffast-math.
extern "C" {
__m256d _ZGVdN4v_log(__m256d);   // NOLINT
__m256d _ZGVdN4v_exp(__m256d);   // NOLINT
__m256d _ZGVdN4v_erfc(__m256d);  // NOLINT
}

namespace holdfast {
namespace {

struct Avx2Pack {
  using V = __m256d;
  using I = __m256i;
  static constexpr std::size_t kLanes = 4;

  static V load(const double* p) { return _mm256_load_pd(p); }
  static void store(double* p, V v) { _mm256_store_pd(p, v); }
  static V set(double v) { return _mm256_set1_pd(v); }
  static V add(V a, V b) { return _mm256_add_pd(a, b); }
  static V sub(V a, V b) { return _mm256_sub_pd(a, b); }
  static V mul(V a, V b) { return _mm256_mul_pd(a, b); }
  static V div(V a, V b) { return _mm256_div_pd(a, b); }
  static V fma(V a, V b, V c) { return _mm256_fmadd_pd(a, b, c); }
  static V negative_fma(V a, V b, V c) { return _mm256_fnmadd_pd(a, b, c); }
  static V min(V a, V b) { return _mm256_min_pd(a, b); }
  static V max(V a, V b) { return _mm256_max_pd(a, b); }
  static V abs(V a) { return _mm256_andnot_pd(_mm256_set1_pd(-0.0), a); }
  static V sqrt(V a) { return _mm256_sqrt_pd(a); }
  static V log(V a) { return _ZGVdN4v_log(a); }
  static V exp(V a) { return _ZGVdN4v_exp(a); }
  static V erfc(V a) { return _ZGVdN4v_erfc(a); }
  static V select_negative(V condition, V if_negative, V otherwise) {
    return _mm256_blendv_pd(otherwise, if_negative, condition);
  }
  static double reduce(V a) {
    const __m128d half = _mm_add_pd(_mm256_castpd256_pd128(a), _mm256_extractf128_pd(a, 1));
    return _mm_cvtsd_f64(half) + _mm_cvtsd_f64(_mm_unpackhi_pd(half, half));
  }

  static I counters(std::uint64_t first, std::uint64_t stride) {
    const auto at = [&](std::uint64_t lane) {
      return static_cast<long long>(first + lane * stride);
    };
    return _mm256_set_epi64x(at(3), at(2), at(1), at(0));
  }
  static I set_integer(std::uint32_t v) { return _mm256_set1_epi64x(v); }
  static I mul_low32(I a, std::uint32_t b) { return _mm256_mul_epu32(a, _mm256_set1_epi64x(b)); }
  static I shift_right_32(I a) { return _mm256_srli_epi64(a, 32); }
  static I bit_xor(I a, I b) { return _mm256_xor_si256(a, b); }
  static V unit(I high, I low) {
    const I bits = _mm256_or_si256(_mm256_slli_epi64(high, 32),
                                   _mm256_and_si256(low, _mm256_set1_epi64x(0xFFFFFFFF)));
    const I one_to_two =
        _mm256_or_si256(_mm256_srli_epi64(bits, 12), _mm256_set1_epi64x(0x3FF0000000000000));
    // Both steps are exact, so this is the same number as in RandomStream.
    return _mm256_add_pd(_mm256_sub_pd(_mm256_castsi256_pd(one_to_two), set(1.0)), set(0x1p-53));
  }
  static V sign_if_bit_1(I k) {
    return _mm256_and_pd(set(-0.0), _mm256_castsi256_pd(_mm256_slli_epi64(k, 62)));
  }
  static V odd_mask(I k) { return _mm256_castsi256_pd(_mm256_slli_epi64(k, 63)); }
  static I add_one(I k) { return _mm256_add_epi64(k, _mm256_set1_epi64x(1)); }
  static I to_bits(V v) { return _mm256_castpd_si256(v); }
  static V flip_sign(V v, V sign) { return _mm256_xor_pd(v, sign); }
  static void circle(V turns, V& cosine, V& sine) { unit_circle<Avx2Pack>(turns, cosine, sine); }

  static V table_row(const DetectionTableView& table, V d2, V& c_0, V& c_1, V& c_2, V& c_3) {
    const I bits = _mm256_castpd_si256(d2);
    const I cell = _mm256_sub_epi64(_mm256_srl_epi64(bits, _mm_cvtsi32_si128(table.shift)),
                                    _mm256_set1_epi64x(table.first_cell));
    // Four loads, since a row is one load, and a transposition.
    const __m128i low = _mm256_castsi256_si128(cell), high = _mm256_extracti128_si256(cell, 1);
    const double* base = table.coefficients;
    const V r_0 = _mm256_load_pd(base + 4 * _mm_cvtsi128_si64(low));
    const V r_1 = _mm256_load_pd(base + 4 * _mm_extract_epi64(low, 1));
    const V r_2 = _mm256_load_pd(base + 4 * _mm_cvtsi128_si64(high));
    const V r_3 = _mm256_load_pd(base + 4 * _mm_extract_epi64(high, 1));
    const V even_01 = _mm256_unpacklo_pd(r_0, r_1), odd_01 = _mm256_unpackhi_pd(r_0, r_1);
    const V even_23 = _mm256_unpacklo_pd(r_2, r_3), odd_23 = _mm256_unpackhi_pd(r_2, r_3);
    c_0 = _mm256_permute2f128_pd(even_01, even_23, 0x20);
    c_1 = _mm256_permute2f128_pd(odd_01, odd_23, 0x20);
    c_2 = _mm256_permute2f128_pd(even_01, even_23, 0x31);
    c_3 = _mm256_permute2f128_pd(odd_01, odd_23, 0x31);
    const I inside = _mm256_and_si256(bits, _mm256_set1_epi64x((1LL << table.shift) - 1));
    return _mm256_sub_pd(
        _mm256_castsi256_pd(_mm256_or_si256(inside, _mm256_set1_epi64x(0x3FF0000000000000))),
        set(1.0));
  }
};

}  // namespace

extern const ParticleKernel kAvx2Kernel;
const ParticleKernel kAvx2Kernel = make_kernel<Avx2Pack>("avx2-libmvec");

}  // namespace holdfast
