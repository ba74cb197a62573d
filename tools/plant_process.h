#pragma once

#include <array>
#include <holdfast/attack_signal_t.hpp>
#include <holdfast/known_input_t.hpp>
#include <holdfast/measurement_set_t.hpp>
#include <holdfast/truth_t.hpp>
#include <memory>
#include <string>
#include <vector>

#include "common/status.h"
#include "drivers/can/can_bus.h"
#include "drivers/can/command_codec.h"
#include "drivers/can/reading_encoder.h"
#include "tools/experiment.h"
#include "tools/frame_record.h"

namespace holdfast {

/// What holdfast-plant does in each step: truth to its own channel, frames on the bus, then the
/// tick.
class PlantProcess {
 public:
  /// bus: null publishes MEASUREMENT directly, as an unattacked bus and driver would.
  PlantProcess(const Experiment& experiment, CanBus* bus, const std::string& bus_url,
               LcmLink& link);

  StatusReporter& status() { return status_; }

  /// Takes the commands that have arrived; all else on the sensor-side bus is not for the plant.
  void on_readable();
  /// Takes the next step; false after the last one.
  bool advance();

 private:
  std::int64_t utime_of(std::int64_t step) const;  // us, time of validity
  void publish_truth(const PlantStep& step);
  void publish_known_input(std::int64_t step);
  void send();
  void obey(const CanFrame& frame);
  void publish_measurements();

  const Experiment& experiment_;
  CanBus* bus_;
  LcmLink& link_;
  StatusReporter status_;
  std::unique_ptr<Plant> plant_;
  FrameCodec codec_;
  ReadingEncoder encoder_;
  CommandCodec command_codec_;
  FrameRecord command_record_;
  MeasurementAssembler assembler_;
  std::unique_ptr<RadioChannel> radio_;
  truth_t truth_;
  attack_signal_t attack_signal_;
  known_input_t known_input_;
  measurement_set_t measurement_;
  std::vector<CanFrame> frames_;
  std::array<CanFrame, 64> batch_;
};

}  // namespace holdfast
