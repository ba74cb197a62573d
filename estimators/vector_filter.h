#pragma once

#include <memory>
#include <vector>

#include "estimators/baseline_options.h"
#include "estimators/innovation_record.h"
#include "estimators/packet_choice.h"
#include "estimators/packet_inbox.h"
#include "estimators/smoothing_estimator.h"
#include "estimators/vector_kernel.h"

namespace holdfast {

/// A filter with one Gaussian that takes one vector of Z_k by PacketChoice; its method is the
/// arithmetic of its kernel. Rows without a packet teach nothing. Can look back.
class VectorFilter : public SmoothingEstimator {
 public:
  const Estimate& step(std::int64_t step, const MeasurementSet& measurements,
                       const Eigen::VectorXd& known_input) override;
  void remember(std::size_t num_steps) override;
  const std::vector<Estimate>& smooth() override;

  /// Sum of the log densities of all vectors that were taken.
  double log_likelihood() const { return log_likelihood_; }
  /// Packets refused since construction.
  std::int64_t refused_packets() const { return inbox_.refused_packets(); }

 protected:
  /// rows[s]: rows of y that a packet of source s carries. Throws UsageError when rows or options
  /// do not fit.
  VectorFilter(std::unique_ptr<VectorKernel> kernel, const SystemModel& model,
               const VectorFilterOptions& options, std::vector<std::vector<int>> rows);

  /// What a step found, for a method that makes a score of it.
  struct Finding {
    PacketChoice::Result choice = PacketChoice::Result::kNoPackets;
    VectorResult result;         // when the choice is kCorrected
    double refused_score = 0.0;  // when it is kRefusedByGate
    int num_rows = 0;
  };
  /// Called at the end of each step, to add to the estimate.
  virtual void judge(const Finding& finding, Estimate& estimate);

 private:
  struct StepLabel {
    std::int64_t step, utime, measurement_seq;
    StepOutcome outcome;
    double attack_probability;
  };

  Finding correct();

  std::unique_ptr<VectorKernel> kernel_;
  PacketInbox inbox_;
  PacketChoice choice_;
  InnovationRecord innovation_;
  bool has_to_move_;
  Estimate estimate_;
  double log_likelihood_ = 0.0;

  std::size_t num_kept_max_ = 0;
  std::vector<StepLabel> labels_;  // of the steps remembered
  std::vector<Estimate> smoothed_;
};

}  // namespace holdfast
