#include "estimators/detection_table.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "common/errors.h"

namespace holdfast {
namespace {

constexpr int kBitsMax = 12;
constexpr double kConstantTo = 1e-15;
constexpr int kOctaveMin = -40, kOctaveMax = 60;  // of d2 in m2; 1e-12 to 1e18

// Chebyshev nodes of a cell, as a fraction of its width, so that the cubic is close to the best
// one.
double node(int i) {
  return 0.5 - 0.5 * std::cos((2 * i + 1) * std::numbers::pi / 8.0);
}

}  // namespace

DetectionLaw make_detection_law(const BinaryTargetModel& model) {
  const auto& glint = model.glint;
  DetectionLaw law;
  law.exponent = -0.5 * model.decay_exponent;
  law.gain = model.source_power * std::pow(model.reference_distance_m, model.decay_exponent);
  const double means[2] = {glint.mean_1, glint.mean_2};
  const double variances[2] = {glint.variance_1, glint.variance_2};
  for (int i = 0; i < 2; ++i) {
    law.scale[i] = 1.0 / std::sqrt(2.0 * variances[i]);
    law.offset[i] = (model.threshold - means[i]) * law.scale[i];
    // erfc(-10) is 2 to the last bit.
    law.energy_max = std::max(law.energy_max, (law.offset[i] + 10.0) / law.scale[i]);
  }
  law.weight[0] = 0.5 * (1.0 - glint.tail_probability);
  law.weight[1] = 0.5 * glint.tail_probability;
  return law;
}

double detection_probability(const DetectionLaw& law, double d2_m2) {
  const double power = std::exp(std::min(law.exponent * std::log(std::max(d2_m2, 1e-300)), 700.0));
  const double energy = std::min(law.gain * power, law.energy_max);
  return law.weight[0] * std::erfc(law.offset[0] - energy * law.scale[0]) +
         law.weight[1] * std::erfc(law.offset[1] - energy * law.scale[1]);
}

DetectionTable::DetectionTable(const DetectionLaw& law) {
  // Octaves at whose ends q still moves; q is monotone in d2.
  const auto q = [&law](int octave) { return detection_probability(law, std::ldexp(1.0, octave)); };
  int low = kOctaveMin, high = kOctaveMax;
  while (low + 1 < high && std::abs(q(low + 1) - q(kOctaveMin)) < kConstantTo) ++low;
  while (high - 1 > low && std::abs(q(high - 1) - q(kOctaveMax)) < kConstantTo) --high;
  view_.low_m2 = std::ldexp(1.0, low);
  // The last number below the power of two still belongs to the last cell.
  view_.high_m2 = std::nextafter(std::ldexp(1.0, high), 0.0);
  for (; bits_ <= kBitsMax; ++bits_) {
    num_cells_ = static_cast<std::size_t>(high - low) << bits_;
    if (fill(law) < kErrorMax) return;
  }
  throw UsageError("likelihood 'table': the glint noise is too narrow for a table; use 'exact'");
}

double DetectionTable::fill(const DetectionLaw& law) {
  coefficients_ = AlignedArray(4 * num_cells_);
  view_.coefficients = coefficients_.data();
  view_.shift = 52 - bits_;
  view_.first_cell = std::bit_cast<std::int64_t>(view_.low_m2) >> view_.shift;
  const double width = std::ldexp(1.0, -bits_);
  double worst = 0.0;
  for (std::size_t cell = 0; cell < num_cells_; ++cell) {
    const auto bits = static_cast<std::uint64_t>(view_.first_cell + static_cast<std::int64_t>(cell))
                      << view_.shift;
    const double start = std::bit_cast<double>(bits);
    const double octave = std::ldexp(1.0, std::ilogb(start));
    const auto q = [&](double fraction) {
      return detection_probability(law, start + fraction * width * octave);
    };
    // Newton's divided differences over the nodes, then expanded to powers.
    double t[4], difference[4];
    for (int i = 0; i < 4; ++i) {
      t[i] = node(i);
      difference[i] = q(t[i]);
    }
    for (int order = 1; order < 4; ++order) {
      for (int i = 3; i >= order; --i) {
        difference[i] = (difference[i] - difference[i - 1]) / (t[i] - t[i - order]);
      }
    }
    double power[4] = {difference[3], 0.0, 0.0, 0.0};
    for (int i = 2; i >= 0; --i) {
      for (int p = 3; p > 0; --p) power[p] = power[p - 1] - t[i] * power[p];
      power[0] = difference[i] - t[i] * power[0];
    }
    const auto cubic = [&](double f) {
      return ((power[3] * f + power[2]) * f + power[1]) * f + power[0];
    };
    for (const double f : {0.0, 0.5 * (t[0] + t[1]), 0.5, 0.5 * (t[2] + t[3]), 1.0}) {
      worst = std::max(worst, std::abs(cubic(f) - q(f)));
    }
    // The kernels' fraction is the mantissa below the cell's bits, in [0, width).
    double scale = 1.0;
    for (std::size_t p = 0; p < 4; ++p, scale /= width)
      coefficients_[4 * cell + p] = power[p] * scale;
  }
  return worst;
}

}  // namespace holdfast
