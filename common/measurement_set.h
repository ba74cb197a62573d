#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace holdfast {

/// What one frame carried: one sensor's reading or one node's vector of readings, for one step.
struct Packet {
  int source = 0;                  // index of the message in the scenario's network.messages
  std::int64_t rx_index = -1;      // nth frame read from the monitor-side bus, -1 without a bus
  std::int64_t receive_utime = 0;  // us, kernel's receive stamp; no estimator may use it
  std::int64_t step_counter = -1;  // step that the frame itself claims, -1 without a counter
  std::uint32_t first_value = 0;   // index into MeasurementSet::values
  std::uint32_t num_values = 0;
};

/// Why a sensor that should have a state has none.
enum class InvalidReason : std::int32_t {
  kNone = 0,  // it has one
  kNeverHeard = 1,
  kSilent = 2,          // no sign of life for too long
  kNotOperational = 3,  // it lives, but is not in the state in which it measures
  kError = 4,           // it says that it is faulty
  kNotAvailable = 5     // it says that it does not know, or has not said anything yet
};
const char* to_string(InvalidReason reason);

/// A sensor whose state is not known in a step; it has no packet then.
struct InvalidReading {
  int source = 0;
  InvalidReason reason = InvalidReason::kNone;
};

/// Z_k: every packet that arrived for step k, in arrival order; none, one, or many of one source.
struct MeasurementSet {
  std::int64_t step = 0;   // k, from 1
  std::int64_t utime = 0;  // us, time of validity on the run's clock
  std::int64_t seq = 0;    // of the message that carried it
  std::vector<Packet> packets;
  std::vector<double> values;           // the packets' values, one packet after the other
  std::vector<InvalidReading> invalid;  // of sensors that keep a state; missing, for estimators

  std::span<const double> values_of(const Packet& packet) const {
    return {values.data() + packet.first_value, packet.num_values};
  }
  void add(Packet packet, std::span<const double> packet_values) {
    packet.first_value = static_cast<std::uint32_t>(values.size());
    packet.num_values = static_cast<std::uint32_t>(packet_values.size());
    values.insert(values.end(), packet_values.begin(), packet_values.end());
    packets.push_back(packet);
  }
  /// Empties the set for another step and keeps its memory.
  void clear(std::int64_t new_step, std::int64_t new_utime) {
    step = new_step;
    utime = new_utime;
    packets.clear();
    values.clear();
    invalid.clear();
  }
};

}  // namespace holdfast
