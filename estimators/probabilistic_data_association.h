#pragma once

#include <vector>

#include "estimators/baseline_options.h"
#include "estimators/estimator.h"
#include "estimators/kalman_core.h"
#include "estimators/packet_association.h"
#include "estimators/packet_inbox.h"

namespace holdfast {

/// Probabilistic data association: a Kalman filter that doubts each packet, but knows of no attack
/// on the plant (PacketAssociation has the equations).
///
/// Sources are taken one after the other, each corrected by all its packets. packet_probability:
/// of each packet being the true one. attack_probability is the score P(chi-square with the rows
/// heard <= sum over sources of the nearest packet's nu' S^-1 nu); without packets the last stands.
class ProbabilisticDataAssociation : public Estimator {
 public:
  /// Throws UsageError when model, options and rows do not fit.
  ProbabilisticDataAssociation(const SystemModel& model,
                               const ProbabilisticDataAssociationOptions& options,
                               std::vector<std::vector<int>> rows);

  const Estimate& step(std::int64_t step, const MeasurementSet& measurements,
                       const Eigen::VectorXd& known_input) override;

  /// Packets refused since construction.
  std::int64_t refused_packets() const { return inbox_.refused_packets(); }

 private:
  void correct();

  KalmanCore core_;
  PacketInbox inbox_;
  PacketAssociation association_;
  Gaussian belief_;
  bool has_started_ = false;
  double score_ = 0.0;
  Estimate estimate_;
};

}  // namespace holdfast
