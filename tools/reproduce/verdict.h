#pragma once

#include <string>

namespace holdfast {

enum class Verdict { kAgrees, kDiffers, kCannotTell };

/// A number with its standard error.
struct Uncertain {
  double value = 0.0, standard_error = 0.0;
};

/// How far apart two numbers may be before they differ: 4 sqrt(se^2 + se_ref^2).
double verdict_band(const Uncertain& ours, const Uncertain& reference);

/// A tenth of the reference's value: a band as wide as this or wider tells nothing.
double widest_band(const Uncertain& reference);

/// differs: |ours - reference| above the band; agrees: not above it, and the band is narrower than
/// band_max; cannot tell: not above a band that is too wide to mean anything, or not finite.
Verdict compare(const Uncertain& ours, const Uncertain& reference, double band_max);

/// True when the reference's own error takes nine tenths of band_max or more, so that no reasonable
/// number of runs helps.
bool is_reference_too_wide(const Uncertain& reference, double band_max);

/// Word of the table: "reproduced", or "consistent with" where the paper leaves something open that
/// we had to choose; "differs"; "cannot tell".
std::string verdict_text(Verdict verdict, bool is_chosen_by_us);

}  // namespace holdfast
