#pragma once

#include <cstdint>
#include <vector>

#include "common/measurement_set.h"
#include "common/random_stream.h"

namespace holdfast {

/// Emulates the radio link of the paper behind a bus that carries plain bits, for simulated runs:
/// y = gain * bit + noise, noise ~ N(0, noise_std^2). Pure.
///
/// Noise comes from the stream "radio" and is addressed by (step, source, index among that source's
/// packets of the step, index of the value): a packet that is dropped or injected shifts the noise
/// of no other source, and of no earlier packet of its own.
class RadioChannel {
 public:
  /// Precondition: noise_std >= 0.
  RadioChannel(double gain, double noise_std, std::uint64_t seed, std::uint32_t run);

  /// Replaces every value of the set. Precondition: sources are those of a FrameCodec. Allocates
  /// only when a source is seen for the first time.
  void apply(MeasurementSet& set);

 private:
  double gain_;
  double noise_std_;
  RandomStream stream_;
  std::vector<std::uint32_t> packets_of_source_;
};

}  // namespace holdfast
