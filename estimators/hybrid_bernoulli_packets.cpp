#include "estimators/hybrid_bernoulli_packets.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "common/errors.h"
#include "estimators/packet_inbox.h"
#include "estimators/padded_matrix.h"

namespace holdfast {
namespace {

void check_rows(const std::vector<std::vector<int>>& rows, int num_measurements) {
  if (rows.empty()) throw UsageError("hybrid Bernoulli filter: at least one source is needed");
  for (std::size_t s = 0; s < rows.size(); ++s) {
    const std::vector<int>& own = rows[s];
    const bool is_ascending =
        std::adjacent_find(own.begin(), own.end(), std::greater_equal<int>()) == own.end();
    if (own.empty() || !is_ascending || own.front() < 0 || own.back() >= num_measurements) {
      throw UsageError("hybrid Bernoulli filter: source " + std::to_string(s) +
                       " must carry ascending rows of the measurement");
    }
  }
}

}  // namespace

int PacketNode::count() const {
  int sum = 0;
  for (const SourcePackets& packets : sources) sum += packets.count;
  return sum;
}

HybridBernoulliPackets::HybridBernoulliPackets(const SystemModel& model,
                                               const HybridBernoulliOptions& options,
                                               const std::vector<std::vector<int>>& rows)
    : rows_(rows),
      low_(options.packet_box_low),
      high_(options.packet_box_high),
      outside_(options.outside),
      log_floor_(std::log(options.outside_floor)) {
  check_rows(rows_, model.num_measurements());
  for (const std::vector<int>& own : rows_) {
    double log_volume = 0.0;
    for (const int row : own) log_volume += std::log(high_[row] - low_[row]);
    log_box_density_.push_back(-log_volume);
  }
  group(model);
}

// Sources join as long as their rows overlap; a label per row is enough to find out.
void HybridBernoulliPackets::group(const SystemModel& model) {
  std::vector<int> label(static_cast<std::size_t>(model.num_measurements()));
  std::iota(label.begin(), label.end(), 0);
  for (bool changed = true; changed;) {
    changed = false;
    for (const std::vector<int>& own : rows_) {
      int smallest = label[static_cast<std::size_t>(own.front())];
      for (const int row : own) {
        smallest = std::min(smallest, label[static_cast<std::size_t>(row)]);
      }
      for (const int row : own) {
        changed = changed || label[static_cast<std::size_t>(row)] != smallest;
        label[static_cast<std::size_t>(row)] = smallest;
      }
    }
  }
  std::vector<int> labels;
  for (std::size_t s = 0; s < rows_.size(); ++s) {
    const int own = label[static_cast<std::size_t>(rows_[s].front())];
    const auto found = std::find(labels.begin(), labels.end(), own);
    const auto node = static_cast<std::size_t>(found - labels.begin());
    if (found == labels.end()) {
      labels.push_back(own);
      nodes_.emplace_back();
    }
    places_.push_back({node, nodes_[node].sources.size()});
    nodes_[node].sources.emplace_back().source = static_cast<int>(s);
  }
  std::vector<char> is_carried(label.size(), 0);
  for (const std::vector<int>& own : rows_) {
    for (const int row : own) is_carried[static_cast<std::size_t>(row)] = 1;
  }
  for (std::size_t i = 0; i < label.size(); ++i) {
    for (std::size_t j = 0; j < label.size(); ++j) {
      const bool is_between = is_carried[i] != 0 && is_carried[j] != 0 && label[i] != label[j];
      if (is_between &&
          model.R(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) != 0.0) {
        throw UsageError("hybrid Bernoulli filter: R correlates rows " + std::to_string(i) +
                         " and " + std::to_string(j) + " of different nodes");
      }
    }
  }
}

double HybridBernoulliPackets::log_false_density(int source, std::span<const double> values) const {
  const double inside = log_box_density_[static_cast<std::size_t>(source)];
  if (outside_ == HybridBernoulliOptions::Outside::kConstant) return inside;
  const std::vector<int>& own = rows_[static_cast<std::size_t>(source)];
  for (std::size_t i = 0; i < own.size(); ++i) {
    if (values[i] >= low_[own[i]] && values[i] <= high_[own[i]]) continue;
    if (outside_ == HybridBernoulliOptions::Outside::kFloor) return inside + log_floor_;
    return -std::numeric_limits<double>::infinity();
  }
  return inside;
}

int HybridBernoulliPackets::read(const MeasurementSet& measurements) {
  for (PacketNode& node : nodes_) {
    for (SourcePackets& packets : node.sources) {
      packets.count = 0;
      packets.position.clear();
      packets.log_false_density.clear();
    }
  }
  int refused = 0;
  for (std::size_t p = 0; p < measurements.packets.size(); ++p) {
    const Packet& packet = measurements.packets[p];
    if (!is_usable(measurements, packet, rows_)) {
      ++refused;
      continue;
    }
    const Place place = places_[static_cast<std::size_t>(packet.source)];
    SourcePackets& packets = nodes_[place.node].sources[place.source];
    ++packets.count;
    packets.position.push_back(static_cast<int>(p));
    packets.log_false_density.push_back(
        log_false_density(packet.source, measurements.values_of(packet)));
  }
  for (PacketNode& node : nodes_) {
    for (SourcePackets& packets : node.sources) {
      const std::size_t rows = rows_[static_cast<std::size_t>(packets.source)].size();
      packets.width = padded::width_of(packets.count);
      packets.Y.assign(rows * static_cast<std::size_t>(packets.width), 0.0);
      for (std::size_t c = 0; c < packets.position.size(); ++c) {
        const Packet& packet = measurements.packets[static_cast<std::size_t>(packets.position[c])];
        const std::span<const double> values = measurements.values_of(packet);
        for (std::size_t i = 0; i < rows; ++i) {
          packets.Y[i * static_cast<std::size_t>(packets.width) + c] = values[i];
        }
      }
    }
  }
  return refused;
}

}  // namespace holdfast
