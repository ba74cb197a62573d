#pragma once

#include <cstdint>
#include <vector>

#include "estimators/baseline_options.h"
#include "estimators/innovation_record.h"
#include "estimators/kalman_core.h"
#include "estimators/packet_choice.h"
#include "estimators/packet_inbox.h"

namespace holdfast {

/// A step of a filter that has one Gaussian and takes one vector of Z_k by PacketChoice.
class VectorCorrection {
 public:
  /// rows[s]: rows of y that a packet of source s carries. Throws UsageError when rows or options
  /// do not fit.
  VectorCorrection(std::vector<std::vector<int>> rows, int num_measurements,
                   const VectorOptions& options);

  /// Predicts the belief (not in the first step), corrects it, and writes step, outcome and
  /// innovation into the estimate. Allocates nothing once it has seen the largest set.
  PacketChoice::Result step(std::int64_t step, const MeasurementSet& measurements, KalmanCore& core,
                            Gaussian& belief, Estimate& estimate);

  /// nu' S^-1 nu of the latest vector.
  double distance() const { return distance_; }
  /// As PacketChoice says, when the gate left out every packet.
  double refused_score() const { return choice_.refused_score(); }
  /// Packets refused since construction.
  std::int64_t refused_packets() const { return inbox_.refused_packets(); }

 private:
  PacketInbox inbox_;
  PacketChoice choice_;
  InnovationRecord innovation_;
  bool has_started_ = false;
  double distance_ = 0.0;
};

}  // namespace holdfast
