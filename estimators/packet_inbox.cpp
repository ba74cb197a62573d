#include "estimators/packet_inbox.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/errors.h"

namespace holdfast {

PacketInbox::PacketInbox(std::vector<std::vector<int>> rows, int num_measurements)
    : rows_(std::move(rows)), ends_(rows_.size() + 1) {
  std::vector<bool> is_taken(static_cast<std::size_t>(num_measurements));
  for (const std::vector<int>& of_source : rows_) {
    if (of_source.empty()) throw UsageError("a source carries no row of y");
    for (const int row : of_source) {
      if (row < 0 || row >= num_measurements) throw UsageError("a source carries a row outside y");
      if (is_taken[static_cast<std::size_t>(row)]) throw UsageError("two sources carry one row");
      is_taken[static_cast<std::size_t>(row)] = true;
    }
  }
}

bool is_usable(const MeasurementSet& measurements, const Packet& packet,
               const std::vector<std::vector<int>>& rows) {
  if (packet.source < 0 || packet.source >= static_cast<int>(rows.size())) return false;
  const std::size_t wanted = rows[static_cast<std::size_t>(packet.source)].size();
  const std::size_t end = std::size_t{packet.first_value} + packet.num_values;
  if (packet.num_values != wanted || end > measurements.values.size()) return false;
  const std::span<const double> values = measurements.values_of(packet);
  return std::all_of(values.begin(), values.end(),
                     [](double value) { return std::abs(value) <= kLargestReading; });
}

void PacketInbox::read(const MeasurementSet& measurements) {
  // Counting sort: ends_[s + 1] first counts, then is where the next packet of source s goes.
  std::fill(ends_.begin(), ends_.end(), 0);
  std::size_t num_usable = 0;
  for (const Packet& packet : measurements.packets) {
    if (!is_usable(measurements, packet, rows_)) continue;
    ++ends_[static_cast<std::size_t>(packet.source) + 1];
    ++num_usable;
  }
  num_refused_ = measurements.packets.size() - num_usable;
  refused_packets_ += static_cast<std::int64_t>(num_refused_);
  packets_.resize(num_usable);
  std::size_t begin = 0;
  for (std::size_t s = 1; s < ends_.size(); ++s) begin += std::exchange(ends_[s], begin);
  for (std::size_t p = 0; p < measurements.packets.size(); ++p) {
    const Packet& packet = measurements.packets[p];
    if (!is_usable(measurements, packet, rows_)) continue;
    std::size_t& next = ends_[static_cast<std::size_t>(packet.source) + 1];
    packets_[next++] = {p, measurements.values_of(packet)};
  }
}

std::span<const UsablePacket> PacketInbox::packets(int source) const {
  const auto s = static_cast<std::size_t>(source);
  return std::span<const UsablePacket>(packets_).subspan(ends_[s], ends_[s + 1] - ends_[s]);
}

void PacketInbox::begin(std::int64_t step, const MeasurementSet& measurements,
                        Estimate& estimate) const {
  estimate.step = step;
  estimate.utime = measurements.utime;
  estimate.measurement_seq = measurements.seq;
  estimate.outcome = num_refused_ > 0    ? StepOutcome::kRefusedInput
                     : num_usable() == 0 ? StepOutcome::kNoPackets
                                         : StepOutcome::kOk;
}

void PacketInbox::list_packets(const MeasurementSet& measurements, Estimate& estimate) {
  estimate.packet_rx_index.clear();
  for (const Packet& packet : measurements.packets) {
    estimate.packet_rx_index.push_back(packet.rx_index);
  }
  estimate.packet_probability.assign(measurements.packets.size(), 0.0);
}

}  // namespace holdfast
