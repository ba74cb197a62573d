#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "common/models/binary_target/binary_target_model.h"

namespace holdfast {

/// Where a target is so near to a sensor, or so far from it, that the sensor's bit does not hang on
/// its noise: whoever simulates readings then needs neither the noise nor the energy.
///
/// A normal draw by Box-Muller is at most sqrt(-2 ln u), u the first of its two uniforms, and so
/// small whenever u is not. What is settled is what h + nu > T (paper 002, eqs. (2)-(4)) comes to
/// in double precision.
class NoiseReach {
 public:
  explicit NoiseReach(const BinaryTargetModel& model);

  /// The bit, where each noise of this component whose normal draw has this first uniform gives the
  /// same one. squared_distance_m2: between target and sensor. Precondition: 0 < uniform < 1.
  std::optional<bool> settled_bit(double squared_distance_m2, bool is_tail, double uniform) const {
    // Its exponent says between which powers of two u lies: u >= 2^-halvings.
    const std::uint64_t halvings = 1023 - (std::bit_cast<std::uint64_t>(uniform) >> 52);
    if (halvings > kHalvingsMax) return std::nullopt;
    const Bounds& bounds = bounds_[is_tail ? 1 : 0][halvings - 1];
    if (squared_distance_m2 < bounds.near_m2) return true;
    if (squared_distance_m2 > bounds.far_m2) return false;
    return std::nullopt;
  }

 private:
  // Smaller uniforms are rare, and settle little.
  static constexpr std::size_t kHalvingsMax = 8;
  struct Bounds {
    double near_m2 = 0.0, far_m2 = 0.0;  // 1 below, 0 above
  };

  // [component][halvings - 1]
  std::array<std::array<Bounds, kHalvingsMax>, 2> bounds_;
};

}  // namespace holdfast
