#include "drivers/measurement_assembler.h"

#include <cmath>
#include <utility>

namespace holdfast {

MeasurementAssembler::MeasurementAssembler(const FrameCodec& codec, const AssemblerOptions& options)
    : codec_(codec), options_(options), states_(codec.make_sensor_states()) {
  filling_.clear(step_, utime_of(step_));
}

std::int64_t MeasurementAssembler::utime_of(std::int64_t step) const {
  return std::llround(static_cast<double>(step) * options_.step_s * 1e6);
}

const MeasurementSet* MeasurementAssembler::on_frame(const CanFrame& frame) {
  const std::int64_t rx_index = counters_.frames++;
  if (is_finished()) {
    ++counters_.after_end;
    return nullptr;
  }
  const std::size_t first_value = filling_.values.size();
  FrameCodec::Decoded decoded = codec_.decode(frame, filling_.values);
  switch (decoded.kind) {
    case FrameCodec::Kind::kUnknown:
      take_unknown(frame, rx_index);
      break;
    case FrameCodec::Kind::kWrongFormat:
      ++counters_.wrong_format;
      break;
    case FrameCodec::Kind::kNonFinite:
      ++counters_.non_finite;
      break;
    case FrameCodec::Kind::kWrongChecksum:
      ++counters_.wrong_checksum;
      break;
    case FrameCodec::Kind::kTick:
      if (options_.closed_by_tick && codec_.tick_matches(decoded.tick_step, step_)) {
        ++counters_.ticks;
        return close_step();
      }
      ++counters_.odd_ticks;
      break;
    case FrameCodec::Kind::kReading:
      if (options_.check_counter && !codec_.counter_matches(decoded.packet.step_counter, step_)) {
        ++counters_.wrong_counter;
        filling_.values.resize(first_value);
        break;
      }
      ++counters_.packets;
      decoded.packet.rx_index = rx_index;
      decoded.packet.receive_utime = frame.receive_time_ns / 1000;
      filling_.packets.push_back(decoded.packet);
      break;
  }
  return nullptr;
}

// It is none of a message, but may be a sensor's.
void MeasurementAssembler::take_unknown(const CanFrame& frame, std::int64_t rx_index) {
  const SensorStates::Taken taken =
      states_ ? states_->on_frame(frame, rx_index, step_) : SensorStates::Taken::kUnknown;
  switch (taken) {
    case SensorStates::Taken::kTaken:
      ++counters_.sensor_frames;
      break;
    case SensorStates::Taken::kWrongFormat:
      ++counters_.wrong_format;
      break;
    case SensorStates::Taken::kUnknown:
      ++counters_.unknown;
      break;
  }
}

const MeasurementSet* MeasurementAssembler::close_step() {
  if (is_finished()) return nullptr;
  if (states_) {
    states_->sample(step_, filling_);
    counters_.packets += static_cast<std::int64_t>(filling_.packets.size());
    counters_.invalid += static_cast<std::int64_t>(filling_.invalid.size());
    to_sensors_.clear();
    states_->ask(step_, to_sensors_);
  }
  std::swap(filling_, closed_);
  closed_.seq = counters_.sets++;
  ++step_;
  filling_.clear(step_, utime_of(step_));
  return &closed_;
}

}  // namespace holdfast
