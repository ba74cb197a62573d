#include "plant/noise_reach.h"

#include <cmath>
#include <limits>
#include <numbers>

namespace holdfast {
namespace {

// Far above what rounding does to energies, noise and distances, far below what anybody could see.
constexpr double kSlack = 1e-9;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Where the energy is `energy`, which is positive: eq. (2) the other way round.
double squared_distance_at(const BinaryTargetModel& model, double energy) {
  const double d0_squared = model.reference_distance_m * model.reference_distance_m;
  return d0_squared * std::pow(energy / model.source_power, -2.0 / model.decay_exponent);
}

}  // namespace

NoiseReach::NoiseReach(const BinaryTargetModel& model) {
  const auto& glint = model.glint;
  for (std::size_t component = 0; component < bounds_.size(); ++component) {
    const double mean = component == 0 ? glint.mean_1 : glint.mean_2;
    const double std_dev = std::sqrt(component == 0 ? glint.variance_1 : glint.variance_2);
    for (std::size_t i = 0; i < kHalvingsMax; ++i) {
      const double reach =
          std_dev * std::sqrt(2.0 * std::numbers::ln2 * static_cast<double>(i + 1));
      const double slack = kSlack * (std::abs(model.threshold) + std::abs(mean) + reach);
      // No energy is negative: above a negative one are all of them.
      const double high = model.threshold - mean + reach + slack;
      const double low = model.threshold - mean - reach - slack;
      Bounds& bounds = bounds_[component][i];
      bounds.near_m2 = high > 0.0   ? squared_distance_at(model, high) * (1.0 - kSlack)
                       : high < 0.0 ? kInfinity
                                    : 0.0;
      bounds.far_m2 = low > 0.0 ? squared_distance_at(model, low) * (1.0 + kSlack) : kInfinity;
    }
  }
}

}  // namespace holdfast
