#include <bit>
#include <numbers>

#include "estimators/particle_kernel_impl.h"

namespace holdfast {

double log_half_erfc(double z) {
  // erfc(z) = exp(-z^2) / sqrt(pi) / (z + (1/2) / (z + (2/2) / (z + (3/2) / ...))): 60 levels give
  // the last digit from z = 3 on.
  double fraction = z;
  for (int level = 60; level > 0; --level) fraction = z + 0.5 * level / fraction;
  return -z * z - std::log(2.0 * std::sqrt(std::numbers::pi) * fraction);
}

double log_glint_tail(const double weight[2], const double z[2]) {
  double logs[2];
  for (int i = 0; i < 2; ++i) {
    const double log_half = z[i] > 5.0 ? log_half_erfc(z[i]) : std::log(0.5 * std::erfc(z[i]));
    logs[i] = weight[i] > 0.0 ? std::log(2.0 * weight[i]) + log_half : -HUGE_VAL;
  }
  const double larger = logs[0] > logs[1] ? logs[0] : logs[1];
  const double smaller = logs[0] > logs[1] ? logs[1] : logs[0];
  return larger + std::log1p(std::exp(smaller - larger));
}

namespace {

struct PortablePack {
  using V = double;
  using I = std::uint64_t;
  static constexpr std::size_t kLanes = 1;

  static V load(const double* p) { return *p; }
  static void store(double* p, V v) { *p = v; }
  static V set(double v) { return v; }
  static V add(V a, V b) { return a + b; }
  static V sub(V a, V b) { return a - b; }
  static V mul(V a, V b) { return a * b; }
  static V div(V a, V b) { return a / b; }
  // Two roundings: a processor without the instruction would emulate std::fma, a hundred times
  // slower.
  static V fma(V a, V b, V c) { return a * b + c; }
  static V negative_fma(V a, V b, V c) { return c - a * b; }
  static V min(V a, V b) { return a < b ? a : b; }
  static V max(V a, V b) { return a > b ? a : b; }
  static V abs(V a) { return std::fabs(a); }
  static V sqrt(V a) { return std::sqrt(a); }
  static V log(V a) { return std::log(a); }
  static V exp(V a) { return std::exp(a); }
  static V erfc(V a) { return std::erfc(a); }
  static V select_negative(V condition, V if_negative, V otherwise) {
    return std::signbit(condition) ? if_negative : otherwise;
  }
  static double reduce(V a) { return a; }

  static I counters(std::uint64_t first, std::uint64_t) { return first; }
  static I set_integer(std::uint32_t v) { return v; }
  static I mul_low32(I a, std::uint32_t b) { return (a & 0xFFFFFFFFU) * b; }
  static I shift_right_32(I a) { return a >> 32; }
  static I bit_xor(I a, I b) { return a ^ b; }
  static V unit(I high, I low) {
    const std::uint64_t bits = (high << 32) | (low & 0xFFFFFFFFU);
    return (static_cast<double>(bits >> 12) + 0.5) * 0x1p-52;
  }
  static void circle(V turns, V& cosine, V& sine) {
    const double angle = 2.0 * std::numbers::pi * turns;
    cosine = std::cos(angle);
    sine = std::sin(angle);
  }
  static V table_row(const DetectionTableView& table, V d2, V& c_0, V& c_1, V& c_2, V& c_3) {
    const auto bits = std::bit_cast<std::uint64_t>(d2);
    const auto cell = static_cast<std::int64_t>(bits >> table.shift) - table.first_cell;
    const double* row = table.coefficients + 4 * cell;
    c_0 = row[0];
    c_1 = row[1];
    c_2 = row[2];
    c_3 = row[3];
    const std::uint64_t inside = bits & ((std::uint64_t{1} << table.shift) - 1);
    return std::bit_cast<double>(inside | 0x3FF0000000000000U) - 1.0;
  }
};

}  // namespace

extern const ParticleKernel kPortableKernel;
const ParticleKernel kPortableKernel = make_kernel<PortablePack>("portable");

}  // namespace holdfast
