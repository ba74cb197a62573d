#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/configuration.h"
#include "common/measurement_set.h"
#include "drivers/can/can_frame.h"
#include "drivers/can/dbc.h"
#include "drivers/can/frame_protection.h"
#include "drivers/sensors/binary_sensors.h"
#include "drivers/sensors/sensor_states.h"

namespace holdfast {

/// Which message of a DBC file orders a mode of the plant, and what the modes are called.
struct CommandLayout {
  std::string message;  // "" when the network carries no commands
  std::string mode_signal = "MODE";
  std::string step_signal = "STEP";     // the step from which the mode holds
  std::vector<std::string> mode_names;  // the signal's value is an index into these

  /// Steps from a command to that at which it acts, unless it says another number: the plant has to
  /// have it by then.
  static constexpr std::int64_t kLeadSteps = 20;

  bool exists() const { return !message.empty(); }
};

/// Which messages of a DBC file are the plant's readings, which one ends a step, and which one goes
/// the other way.
struct FrameLayout {
  Dbc dbc;
  std::vector<std::string> messages;  // source i is messages[i]
  std::vector<std::string> signals;  // values of a packet, in this order; the same for each message
  std::string counter_signal;        // "" when frames carry no step counter
  std::string tick_message = "StepTick";
  std::string tick_signal = "STEP";
  CommandLayout command;  // its names of modes are the plant's, which is not known here
  std::vector<FrameProtection> protection;
  // In place of messages and signals, which then hold the sensors' names and "STATE".
  BinarySensors sensors;

  /// True when frames go from the monitor-side to the sensor-side bus.
  bool has_way_back() const { return command.exists() || sensors.have_way_back(); }

  /// Null for a message that is not protected.
  const FrameProtection* find_protection(const std::string& message) const;

  /// Reads the keys dbc (a file, relative to the folder) or dbc_text (its text), messages, signals,
  /// counter_signal, tick.message, tick.signal, command.message, command.mode, command.step,
  /// protection, and in place of messages and signals sensors and sensor_options.
  ///
  /// The resolved document holds dbc_text in place of dbc, so that it needs no other file. Reported
  /// on the map: each problem of the DBC, names that it lacks, and what a codec cannot be made of.
  void read(ConfigurationMap map, const std::string& folder);
};

/// Readings <-> frames by DBC. Pure.
class FrameCodec {
 public:
  /// Precondition: the layout was read without problems. Throws UsageError for names that the
  /// layout's DBC lacks.
  explicit FrameCodec(const FrameLayout& layout);

  std::size_t num_sources() const { return messages_.size(); }
  /// None where each reading is a message, which encode() and decode() speak of.
  std::optional<SensorStates> make_sensor_states() const;
  std::optional<SensorTwins> make_sensor_twins() const;

  /// The frame that carries the values of one source for one step, protected; a value beyond its
  /// signal's range saturates. Precondition: source is in range, one value for each of the layout's
  /// signals.
  CanFrame encode(int source, std::span<const double> values, std::int64_t step) const;
  CanFrame encode_tick(std::int64_t step) const;

  enum class Kind {
    kReading,
    kTick,
    kUnknown,      // identifier (with its width) that is none of the layout's
    kWrongFormat,  // length, FD, remote or error unlike the layout's, or its signals not selected
    kNonFinite,    // NaN or infinity
    kWrongChecksum
  };
  struct Decoded {
    Kind kind = Kind::kUnknown;
    Packet packet;               // of a reading: source, step_counter, first_value, num_values
    std::int64_t tick_step = 0;  // modulo 2^tick bits
  };
  /// Values of a reading are appended to `values`; in all other cases `values` stays as it was.
  Decoded decode(const CanFrame& frame, std::vector<double>& values) const;

  /// True when a counter read from a frame (or tick) stands for this step, its width considered.
  /// True for every counter when the layout has none.
  bool counter_matches(std::int64_t counter, std::int64_t step) const;
  bool tick_matches(std::int64_t tick_step, std::int64_t step) const;

  std::uint32_t tick_identifier() const { return tick_.identifier; }
  /// True for a well-formed tick of any step.
  bool is_tick(const CanFrame& frame) const { return tick_.matches(frame); }
  const DbcMessage& tick_message() const { return tick_; }
  const DbcSignal& tick_signal() const { return tick_step_; }

 private:
  struct Entry {
    DbcMessage message;
    std::vector<DbcSignal> values;
    std::optional<DbcSignal> counter;
    std::optional<FrameProtection> protection;
    std::vector<DbcSignal> multiplexed;  // those of values and counter
    CanFrame empty;                      // their selectors set
  };
  static Entry make_entry(const FrameLayout& layout, const std::string& message_name);
  int entry_of(const CanFrame& frame) const;

  std::vector<Entry> messages_;
  std::vector<std::int32_t> entry_of_standard_;                            // by 11-bit identifier
  std::vector<std::pair<std::uint32_t, std::int32_t>> entry_of_extended_;  // sorted by identifier
  DbcMessage tick_;
  DbcSignal tick_step_;
  std::uint64_t counter_mask_ = 0;  // 0: no counter
  std::uint64_t tick_mask_ = 0;
  BinarySensors sensors_;
  Dbc dbc_;  // of the sensors
};

}  // namespace holdfast
