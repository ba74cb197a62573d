#include "tools/reproduce/verdict.h"

#include <cmath>

namespace holdfast {
namespace {

constexpr double kStandardErrors = 4.0;
constexpr double kBandShareMax = 0.1;
// A reference that takes nearly the whole band by itself would ask for endless runs of ours.
constexpr double kReferenceShareMax = 0.9;

}  // namespace

double verdict_band(const Uncertain& ours, const Uncertain& reference) {
  return kStandardErrors * std::hypot(ours.standard_error, reference.standard_error);
}

double widest_band(const Uncertain& reference) {
  return kBandShareMax * std::abs(reference.value);
}

Verdict compare(const Uncertain& ours, const Uncertain& reference, double band_max) {
  const double band = verdict_band(ours, reference);
  const double distance = std::abs(ours.value - reference.value);
  if (!std::isfinite(band) || !std::isfinite(distance)) return Verdict::kCannotTell;
  if (distance > band) return Verdict::kDiffers;
  return band < band_max ? Verdict::kAgrees : Verdict::kCannotTell;
}

bool is_reference_too_wide(const Uncertain& reference, double band_max) {
  return kStandardErrors * reference.standard_error >= kReferenceShareMax * band_max;
}

std::string verdict_text(Verdict verdict, bool is_chosen_by_us) {
  switch (verdict) {
    case Verdict::kAgrees:
      return is_chosen_by_us ? "consistent with" : "reproduced";
    case Verdict::kDiffers:
      return "differs";
    case Verdict::kCannotTell:
      break;
  }
  return "cannot tell";
}

}  // namespace holdfast
