#include "drivers/radio_channel.h"

#include <algorithm>

namespace holdfast {

RadioChannel::RadioChannel(double gain, double noise_std, std::uint64_t seed, std::uint32_t run)
    : gain_(gain), noise_std_(noise_std), stream_(seed, run, "radio") {}

void RadioChannel::apply(MeasurementSet& set) {
  std::fill(packets_of_source_.begin(), packets_of_source_.end(), 0);
  const auto step = static_cast<std::uint32_t>(set.step);
  for (const Packet& packet : set.packets) {
    const auto source = static_cast<std::size_t>(packet.source);
    if (source >= packets_of_source_.size()) packets_of_source_.resize(source + 1, 0);
    const std::uint64_t index = packets_of_source_[source]++;
    // 24 bits of source, 24 of packet index, 16 of value index: more than a step can hold.
    const std::uint64_t first_draw = (static_cast<std::uint64_t>(source) << 40) | (index << 16);
    for (std::uint32_t i = 0; i < packet.num_values; ++i) {
      double& value = set.values[packet.first_value + i];
      value = gain_ * value + noise_std_ * stream_.normal(step, first_draw + i);
    }
  }
}

}  // namespace holdfast
