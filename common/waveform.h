#pragma once

#include <string>
#include <vector>

#include "common/configuration.h"

namespace holdfast {

/// A signal over time: of an attack or a known input. t is the time since it began.
///
///   constant  offset + amplitude
///   sine      offset + amplitude sin(w t + phase)          cosine likewise
///   square    offset + amplitude while (w t + phase) mod 2 pi < pi, else offset - amplitude
///   sawtooth  offset + amplitude ((w t + phase) mod 2 pi / pi - 1), rising from -1 to 1
///   ramp      offset + amplitude t
///   samples   offset + amplitude samples[step since it began]; zero after the last one
///   random_walk  offset + amplitude x, x the walk: 0 in the first step, N(0, 1) more in each later
/// with w = frequency_radps; square and sawtooth are those of paper 003.
struct Waveform {
  enum class Kind { kConstant, kSine, kCosine, kSquare, kSawtooth, kRamp, kSamples, kRandomWalk };

  Kind kind = Kind::kConstant;
  double amplitude = 1.0, offset = 0.0;
  double frequency_radps = 1.0, phase_rad = 0.0;
  std::vector<double> samples;

  /// Keys waveform, amplitude, offset, frequency_radps, phase_rad, and samples or file: a text of
  /// numbers, one a line, relative to the folder. The resolved document holds samples, never file.
  /// may_walk: whoever uses the signal has draws for a random walk; else that is refused.
  void read(ConfigurationMap& map, const std::string& folder, bool may_walk = false);
  /// step: steps since the signal began, from 0, of step_s each. walk: of a random walk, in that
  /// step.
  double value(std::int64_t step, double step_s, double walk = 0.0) const;
};

}  // namespace holdfast
