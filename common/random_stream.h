#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

namespace holdfast {

/// A named stream of random numbers, addressed by (step, draw) instead of by order of calls.
///
/// Philox4x32-10 (Salmon et al., SC11) keyed by the scenario's seed and the stream's name, with
/// counter (draw, step, run). Two calls with the same arguments give the same number, whatever was
/// called before, on whatever thread or process.
class RandomStream {
 public:
  RandomStream(std::uint64_t seed, std::uint32_t run, std::string_view name);

  /// Uniform on the open interval (0, 1), 52 bits.
  double uniform(std::uint32_t step, std::uint64_t draw) const;

  /// Uniform draws 2 pair and 2 pair + 1, in the time of one.
  std::array<double, 2> uniforms(std::uint32_t step, std::uint64_t pair) const;

  /// Standard normal by Box-Muller; draws 2 i and 2 i + 1 are the cosine and the sine of one pair.
  double normal(std::uint32_t step, std::uint64_t draw) const;

  /// Normal draw 2 pair, made of uniforms(step, pair) that are there already.
  static double normal_of(const std::array<double, 2>& uniforms);

  /// Normal draws 2 pair and 2 pair + 1, in less than the time of both.
  std::array<double, 2> normals(std::uint32_t step, std::uint64_t pair) const;

  /// Poisson by inversion of the uniform draw. Precondition: 0 <= mean <= 500.
  int poisson(double mean, std::uint32_t step, std::uint64_t draw) const;

  /// Raw words of two uniforms: block i holds uniform draws 2 i and 2 i + 1. For bulk kernels.
  std::uint64_t key() const { return key_; }
  std::uint32_t run() const { return run_; }

 private:
  std::uint64_t key_;
  std::uint32_t run_;
};

/// FNV-1a, 64 bits: a hash whose values stay the same on every machine and in every version.
std::uint64_t stable_hash(std::string_view text);

}  // namespace holdfast
