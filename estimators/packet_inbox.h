#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/measurement_set.h"
#include "estimators/estimate.h"

namespace holdfast {

/// False for a packet of an unknown source, with a wrong number of values, with values that the set
/// does not hold, or with one that is not finite or beyond kLargestReading. rows[s]: rows of y that
/// a packet of source s carries.
bool is_usable(const MeasurementSet& measurements, const Packet& packet,
               const std::vector<std::vector<int>>& rows);

/// Beyond any reading; squares of innovations stay finite below it.
inline constexpr double kLargestReading = 1e100;

/// A packet that passed the inbox.
struct UsablePacket {
  std::size_t index = 0;           // in MeasurementSet::packets
  std::span<const double> values;  // of the rows that its source carries
};

/// Z_k at an estimator's door: refuses and counts what cannot be used, sorts the rest by source.
///
/// Refused is a packet that is not is_usable(). Allocates nothing once it has seen the largest set.
class PacketInbox {
 public:
  /// rows[s]: rows of y that a packet of source s carries. Throws UsageError for a row that is
  /// outside 0 .. num_measurements - 1 or stands in two places.
  PacketInbox(std::vector<std::vector<int>> rows, int num_measurements);

  /// The spans hold as long as the set stands unchanged.
  void read(const MeasurementSet& measurements);

  int num_sources() const { return static_cast<int>(rows_.size()); }
  const std::vector<int>& rows(int source) const { return rows_[static_cast<std::size_t>(source)]; }
  /// Of one source, in order of arrival.
  std::span<const UsablePacket> packets(int source) const;
  std::size_t num_usable() const { return packets_.size(); }
  std::size_t num_refused() const { return num_refused_; }  // of the latest set
  std::int64_t refused_packets() const { return refused_packets_; }

  /// Step, time and sequence number of the set, and the outcome as far as the packets decide it.
  void begin(std::int64_t step, const MeasurementSet& measurements, Estimate& estimate) const;
  /// Every packet of the set by its rx_index, refused ones too, each with probability 0.
  static void list_packets(const MeasurementSet& measurements, Estimate& estimate);

 private:
  std::vector<std::vector<int>> rows_;
  std::vector<UsablePacket> packets_;
  std::vector<std::size_t> ends_;  // of each source's packets
  std::size_t num_refused_ = 0;
  std::int64_t refused_packets_ = 0;
};

}  // namespace holdfast
