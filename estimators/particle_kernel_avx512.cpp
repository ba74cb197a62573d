// Compiled with -mavx512f -mavx512dq -mavx512vl, used only where the processor has them.

#include <immintrin.h>

#include "estimators/particle_circle_impl.h"
#include "estimators/particle_kernel_impl.h"

// glibc's vector mathematics (libmvec), by the names of the x86-64 vector function ABI: the headers
// offer them only to -ffast-math.
extern "C" {
__m512d _ZGVeN8v_log(__m512d);   // NOLINT
__m512d _ZGVeN8v_exp(__m512d);   // NOLINT
__m512d _ZGVeN8v_erfc(__m512d);  // NOLINT
}

namespace holdfast {
namespace {

struct Avx512Pack {
  using V = __m512d;
  using I = __m512i;
  static constexpr std::size_t kLanes = 8;

  static V load(const double* p) { return _mm512_load_pd(p); }
  static void store(double* p, V v) { _mm512_store_pd(p, v); }
  static V set(double v) { return _mm512_set1_pd(v); }
  static V add(V a, V b) { return _mm512_add_pd(a, b); }
  static V sub(V a, V b) { return _mm512_sub_pd(a, b); }
  static V mul(V a, V b) { return _mm512_mul_pd(a, b); }
  static V div(V a, V b) { return _mm512_div_pd(a, b); }
  static V fma(V a, V b, V c) { return _mm512_fmadd_pd(a, b, c); }
  static V negative_fma(V a, V b, V c) { return _mm512_fnmadd_pd(a, b, c); }
  static V min(V a, V b) { return _mm512_min_pd(a, b); }
  static V max(V a, V b) { return _mm512_max_pd(a, b); }
  static V abs(V a) { return _mm512_andnot_pd(_mm512_set1_pd(-0.0), a); }
  static V sqrt(V a) { return _mm512_sqrt_pd(a); }
  static V log(V a) { return _ZGVeN8v_log(a); }
  static V exp(V a) { return _ZGVeN8v_exp(a); }
  static V erfc(V a) { return _ZGVeN8v_erfc(a); }
  static V select_negative(V condition, V if_negative, V otherwise) {
    return _mm512_mask_blend_pd(_mm512_movepi64_mask(_mm512_castpd_si512(condition)), otherwise,
                                if_negative);
  }
  static double reduce(V a) {
    const __m256d quarter = _mm256_add_pd(_mm512_castpd512_pd256(a), _mm512_extractf64x4_pd(a, 1));
    const __m128d half =
        _mm_add_pd(_mm256_castpd256_pd128(quarter), _mm256_extractf128_pd(quarter, 1));
    return _mm_cvtsd_f64(half) + _mm_cvtsd_f64(_mm_unpackhi_pd(half, half));
  }

  static I counters(std::uint64_t first, std::uint64_t stride) {
    const auto at = [&](std::uint64_t lane) {
      return static_cast<long long>(first + lane * stride);
    };
    return _mm512_set_epi64(at(7), at(6), at(5), at(4), at(3), at(2), at(1), at(0));
  }
  static I set_integer(std::uint32_t v) { return _mm512_set1_epi64(v); }
  static I mul_low32(I a, std::uint32_t b) { return _mm512_mul_epu32(a, _mm512_set1_epi64(b)); }
  static I shift_right_32(I a) { return _mm512_srli_epi64(a, 32); }
  static I bit_xor(I a, I b) { return _mm512_xor_si512(a, b); }
  static V unit(I high, I low) {
    const I bits = _mm512_or_si512(_mm512_slli_epi64(high, 32),
                                   _mm512_and_si512(low, _mm512_set1_epi64(0xFFFFFFFF)));
    const I one_to_two =
        _mm512_or_si512(_mm512_srli_epi64(bits, 12), _mm512_set1_epi64(0x3FF0000000000000));
    // Both steps are exact, so this is the same number as in RandomStream.
    return _mm512_add_pd(_mm512_sub_pd(_mm512_castsi512_pd(one_to_two), set(1.0)), set(0x1p-53));
  }
  static V sign_if_bit_1(I k) {
    return _mm512_and_pd(set(-0.0), _mm512_castsi512_pd(_mm512_slli_epi64(k, 62)));
  }
  static V odd_mask(I k) { return _mm512_castsi512_pd(_mm512_slli_epi64(k, 63)); }
  static I add_one(I k) { return _mm512_add_epi64(k, _mm512_set1_epi64(1)); }
  static I to_bits(V v) { return _mm512_castpd_si512(v); }
  static V flip_sign(V v, V sign) { return _mm512_xor_pd(v, sign); }
  static void circle(V turns, V& cosine, V& sine) { unit_circle<Avx512Pack>(turns, cosine, sine); }

  static V table_row(const DetectionTableView& table, V d2, V& c_0, V& c_1, V& c_2, V& c_3) {
    const I bits = _mm512_castpd_si512(d2);
    const I cell = _mm512_sub_epi64(_mm512_srl_epi64(bits, _mm_cvtsi32_si128(table.shift)),
                                    _mm512_set1_epi64(table.first_cell));
    // Eight loads, since a row is one load, and a transposition.
    alignas(64) long long cells[8];
    _mm512_store_si512(cells, cell);
    const auto rows = [&](int lane) {
      return _mm512_insertf64x4(
          _mm512_castpd256_pd512(_mm256_load_pd(table.coefficients + 4 * cells[lane])),
          _mm256_load_pd(table.coefficients + 4 * cells[lane + 4]), 1);
    };
    const V r_0 = rows(0), r_1 = rows(1), r_2 = rows(2), r_3 = rows(3);
    const V even_01 = _mm512_unpacklo_pd(r_0, r_1), odd_01 = _mm512_unpackhi_pd(r_0, r_1);
    const V even_23 = _mm512_unpacklo_pd(r_2, r_3), odd_23 = _mm512_unpackhi_pd(r_2, r_3);
    const I low_halves = _mm512_set_epi64(13, 12, 5, 4, 9, 8, 1, 0);
    const I high_halves = _mm512_set_epi64(15, 14, 7, 6, 11, 10, 3, 2);
    c_0 = _mm512_permutex2var_pd(even_01, low_halves, even_23);
    c_1 = _mm512_permutex2var_pd(odd_01, low_halves, odd_23);
    c_2 = _mm512_permutex2var_pd(even_01, high_halves, even_23);
    c_3 = _mm512_permutex2var_pd(odd_01, high_halves, odd_23);
    const I inside = _mm512_and_si512(bits, _mm512_set1_epi64((1LL << table.shift) - 1));
    return _mm512_sub_pd(
        _mm512_castsi512_pd(_mm512_or_si512(inside, _mm512_set1_epi64(0x3FF0000000000000))),
        set(1.0));
  }
};

}  // namespace

extern const ParticleKernel kAvx512Kernel;
const ParticleKernel kAvx512Kernel = make_kernel<Avx512Pack>("avx512-libmvec");

}  // namespace holdfast
