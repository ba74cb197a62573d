#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "drivers/can/frame_codec.h"
#include "tools/plant_setup.h"

namespace holdfast {

/// What rules on the bus add to those channels of a plant's attack that are the sensor of one
/// measurement each (a column of G that is zero, a column of H with one entry): together with what
/// the plant adds itself it is the true input that estimators are scored against.
class BusInputs {
 public:
  /// Precondition: the plant was read without problems.
  /// codec: of the network, and must outlive this. checks_counter: a reading with another step's
  /// counter is refused by whoever reads it.
  BusInputs(const PlantSetup& plant, const FrameCodec& codec, bool checks_counter);

  /// False when no channel is of that kind: nothing that happens to frames is an input.
  bool exists() const { return !channels_.empty(); }
  int num_channels() const { return num_channels_; }
  /// Adds what a rule made of a reading: of each of its values (forwarded - original) / H. A frame
  /// that is no reading of the step, and a value that is not finite, add nothing.
  void add(std::int64_t step, const CanFrame& original, const CanFrame& forwarded,
           std::span<double> attack);

 private:
  struct Channel {
    int source = 0;
    std::size_t value = 0;  // place in that source's packet
    int channel = 0;
    double gain = 1.0;
  };

  const FrameCodec& codec_;
  bool checks_counter_;
  int num_channels_ = 0;
  std::vector<Channel> channels_;
  std::vector<double> before_, after_;
};

}  // namespace holdfast
