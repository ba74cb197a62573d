#include "common/random_stream.h"

#include <Random123/philox.h>

#include <cmath>
#include <numbers>

namespace holdfast {
namespace {

// SplitMix64's finaliser: seeds 1, 2, 3 must not give neighbouring keys.
std::uint64_t scramble(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15U;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9U;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBU;
  return x ^ (x >> 31);
}

double to_unit_interval(std::uint32_t high, std::uint32_t low) {
  const std::uint64_t bits = (static_cast<std::uint64_t>(high) << 32) | low;
  return (static_cast<double>(bits >> 12) + 0.5) * 0x1p-52;
}

r123::Philox4x32::ctr_type block(std::uint64_t key, std::uint32_t run, std::uint32_t step,
                                 std::uint64_t index) {
  const r123::Philox4x32::ctr_type counter = {
      {static_cast<std::uint32_t>(index), static_cast<std::uint32_t>(index >> 32), step, run}};
  const r123::Philox4x32::key_type words = {
      {static_cast<std::uint32_t>(key), static_cast<std::uint32_t>(key >> 32)}};
  return r123::Philox4x32{}(counter, words);
}

// Radius and angle of a pair of normals.
std::array<double, 2> polar(const std::array<double, 2>& uniforms) {
  return {std::sqrt(-2.0 * std::log(uniforms[0])), 2.0 * std::numbers::pi * uniforms[1]};
}

}  // namespace

std::uint64_t stable_hash(std::string_view text) {
  std::uint64_t hash = 0xCBF29CE484222325U;
  for (const char c : text) {
    hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3U;
  }
  return hash;
}

RandomStream::RandomStream(std::uint64_t seed, std::uint32_t run, std::string_view name)
    : key_(scramble(scramble(seed) ^ stable_hash(name))), run_(run) {}

double RandomStream::uniform(std::uint32_t step, std::uint64_t draw) const {
  const auto words = block(key_, run_, step, draw / 2);
  return draw % 2 == 0 ? to_unit_interval(words[0], words[1])
                       : to_unit_interval(words[2], words[3]);
}

std::array<double, 2> RandomStream::uniforms(std::uint32_t step, std::uint64_t pair) const {
  const auto words = block(key_, run_, step, pair);
  return {to_unit_interval(words[0], words[1]), to_unit_interval(words[2], words[3])};
}

double RandomStream::normal(std::uint32_t step, std::uint64_t draw) const {
  const auto [radius, angle] = polar(uniforms(step, draw / 2));
  return radius * (draw % 2 == 0 ? std::cos(angle) : std::sin(angle));
}

double RandomStream::normal_of(const std::array<double, 2>& uniforms) {
  const auto [radius, angle] = polar(uniforms);
  return radius * std::cos(angle);
}

std::array<double, 2> RandomStream::normals(std::uint32_t step, std::uint64_t pair) const {
  const auto [radius, angle] = polar(uniforms(step, pair));
  return {radius * std::cos(angle), radius * std::sin(angle)};
}

int RandomStream::poisson(double mean, std::uint32_t step, std::uint64_t draw) const {
  const double target = uniform(step, draw);
  double probability = std::exp(-mean);
  double cumulative = probability;
  int count = 0;
  // The bound only matters when rounding keeps the sum below a target close to one.
  const int count_max = static_cast<int>(mean + 40.0 * std::sqrt(mean + 1.0)) + 40;
  while (cumulative < target && count < count_max) {
    ++count;
    probability *= mean / count;
    cumulative += probability;
  }
  return count;
}

}  // namespace holdfast
