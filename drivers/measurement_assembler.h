#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "common/measurement_set.h"
#include "drivers/can/frame_codec.h"

namespace holdfast {

/// What became of the frames that a driver read. Always frames = packets + unknown + wrong_format +
/// non_finite + wrong_checksum + wrong_counter + ticks + odd_ticks + after_end; where sensors keep
/// a state, with sensor_frames in place of packets.
struct AssemblerCounters {
  std::int64_t frames = 0;         // all that were read
  std::int64_t packets = 0;        // kept in a set
  std::int64_t sensor_frames = 0;  // that told of a sensor's state
  std::int64_t invalid = 0;        // sensors in sets without a known state
  std::int64_t unknown = 0;        // identifier that is none of the layout's
  std::int64_t wrong_format = 0;   // length, FD, remote or width unlike the layout's
  std::int64_t non_finite = 0;     // NaN or infinity in a float signal
  std::int64_t wrong_checksum = 0;
  std::int64_t wrong_counter = 0;  // claims another step than the one it arrived in
  std::int64_t ticks = 0;          // that closed a step
  std::int64_t odd_ticks = 0;      // a tick that is not the next one, or that nobody waits for
  std::int64_t after_end = 0;      // arrived after the last tick
  std::int64_t sets = 0;
};

struct AssemblerOptions {
  bool check_counter = true;   // false: "counter_check: ignore"
  bool closed_by_tick = true;  // false: the owner calls close_step() by its own clock
  std::int64_t num_steps = 0;  // the tick of this step ends the run; 0: no end
  double step_s = 1.0;         // model time of a step, for utime
};

/// Groups packets by step: Z_k is every packet that arrived between tick k-1 and tick k; of sensors
/// that keep a state one for each whose state is known when tick k comes. Pure.
///
/// A packet's rx_index counts every frame that was given to on_frame(), from 0; a set's seq counts
/// sets, from 0; its utime is step * step_s. No allocation once the sets have grown to their size.
class MeasurementAssembler {
 public:
  /// The codec must outlive the assembler.
  MeasurementAssembler(const FrameCodec& codec, const AssemblerOptions& options);

  /// Takes the next frame of the bus. Returns the set that this frame closed, or nullptr. The set
  /// is valid until the next call.
  const MeasurementSet* on_frame(const CanFrame& frame);
  /// Closes the current step by the owner's clock; nullptr when the run has ended.
  const MeasurementSet* close_step();

  /// What sensors are to be told or asked after the step that was closed last; valid as its set is.
  const std::vector<CanFrame>& to_sensors() const { return to_sensors_; }

  std::int64_t current_step() const { return step_; }  // the one being filled, from 1
  /// True after the last step was closed; never when there is no end.
  bool is_finished() const { return options_.num_steps > 0 && step_ > options_.num_steps; }
  const AssemblerCounters& counters() const { return counters_; }

 private:
  void take_unknown(const CanFrame& frame, std::int64_t rx_index);
  std::int64_t utime_of(std::int64_t step) const;

  const FrameCodec& codec_;
  AssemblerOptions options_;
  std::int64_t step_ = 1;
  std::optional<SensorStates> states_;
  std::vector<CanFrame> to_sensors_;
  MeasurementSet filling_, closed_;
  AssemblerCounters counters_;
};

}  // namespace holdfast
