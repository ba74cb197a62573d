#pragma once

#include <array>
#include <holdfast/measurement_set_t.hpp>
#include <memory>
#include <string>

#include "common/status.h"
#include "drivers/can/can_bus.h"
#include "drivers/can/command_codec.h"
#include "tools/experiment.h"
#include "tools/frame_record.h"

namespace holdfast {

/// What holdfast-can-driver does: frames of the monitor-side bus in, measurement sets out; the
/// operator's commands back onto the bus.
class DriverProcess {
 public:
  DriverProcess(const Experiment& experiment, LcmLink& link, const std::string& bus_url);

  StatusReporter& status() { return status_; }
  bool is_finished() const { return assembler_.is_finished(); }
  bool has_frames() const { return assembler_.counters().frames > 0; }

  /// Reads all that has arrived.
  void on_readable(CanBus& bus);
  /// Of a bus that is only read: nothing is sent.
  void set_read_only() { can_write_ = false; }
  /// From now on steps end by the frames' stamps, so long after the first one, and so on: for a
  /// recording of a bus without ticks.
  void close_by_stamps(std::int64_t period_ns) { period_ns_ = period_ns; }
  /// Closes the step by the driver's own clock.
  void close_step(CanBus& bus);
  void publish_status(CanBus& bus);
  /// Publishes the record of frames that came after the last closed step.
  void flush_record() { record_.flush(assembler_.current_step()); }

 private:
  void publish(const MeasurementSet& closed);
  void send_commands(CanBus& bus);
  void close_until(std::int64_t stamp_ns, CanBus& bus);

  const Experiment& experiment_;
  LcmLink& link_;
  StatusReporter status_;
  FrameCodec codec_;
  CommandCodec command_codec_;
  MeasurementAssembler assembler_;
  std::unique_ptr<RadioChannel> radio_;
  FrameRecord record_;
  bool can_write_ = true;
  std::array<CanFrame, 64> batch_;
  std::int64_t period_ns_ = 0, next_close_ns_ = 0;  // 0: steps do not end by stamps
  MeasurementSet set_;
  measurement_set_t measurement_;
};

}  // namespace holdfast
