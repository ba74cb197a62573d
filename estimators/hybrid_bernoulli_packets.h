#pragma once

#include <cstdint>
#include <vector>

#include "common/measurement_set.h"
#include "common/models/system_model.h"
#include "estimators/hybrid_bernoulli_options.h"

namespace holdfast {

/// The packets of one source at one step, as columns.
struct SourcePackets {
  int source = 0;
  int count = 0, width = 0;               // packets, and the same padded
  std::vector<double> Y;                  // [rows of the source x count], row-major, padded
  std::vector<double> log_false_density;  // log kappa of each, -infinity when it has none
  std::vector<int> position;              // of each, in the measurement set
};

/// Sources of which one packet at most is authentic (see HybridBernoulliFilter).
struct PacketNode {
  std::vector<SourcePackets> sources;
  int count() const;
};

/// Sorts a measurement set by node and source, and refuses what no filter can use.
class HybridBernoulliPackets {
 public:
  /// Throws UsageError when rows are empty, out of range or not ascending, or when R correlates
  /// nodes.
  HybridBernoulliPackets(const SystemModel& model, const HybridBernoulliOptions& options,
                         const std::vector<std::vector<int>>& rows);

  /// Takes the packets of a step; how many were refused.
  int read(const MeasurementSet& measurements);
  const std::vector<PacketNode>& nodes() const { return nodes_; }

 private:
  struct Place {
    std::size_t node = 0, source = 0;
  };

  void group(const SystemModel& model);
  double log_false_density(int source, std::span<const double> values) const;

  std::vector<std::vector<int>> rows_;
  Eigen::VectorXd low_, high_;
  HybridBernoulliOptions::Outside outside_;
  double log_floor_;
  std::vector<Place> places_;  // per source
  std::vector<double> log_box_density_;
  std::vector<PacketNode> nodes_;
};

}  // namespace holdfast
