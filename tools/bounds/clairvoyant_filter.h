#pragma once

#include <vector>

#include "estimators/baseline_options.h"
#include "estimators/estimator.h"
#include "estimators/innovation_record.h"
#include "estimators/kalman_core.h"
#include "estimators/packet_choice.h"
#include "estimators/packet_inbox.h"
#include "tools/bounds/told_estimator.h"

namespace holdfast {

/// What a clairvoyant filter believes; the scenario's filter's own keys.
struct ClairvoyantFilterOptions {
  GaussianOptions start;                         // x_1 before Z_1
  GaussianOptions attack_prior{{}, {10.0}, {}};  // p(a)
  Feedthrough feedthrough = Feedthrough::kAuto;
};

/// The Kalman recursion that knows which packets are authentic and which steps are attacked, but
/// not by what: the bound for every filter that has to find that out (method page of the hybrid
/// Bernoulli filter, section 6, "clair").
///
/// In an attacked step the belief is on z = [x; a] with a ~ p(a), in others on x alone; KalmanCore
/// has the equations. Delayed: y_k tells of a_{k-1}, so the belief has it when step k - 1 was
/// attacked. attack_probability: 1 when the belief has an input, else 0, and the input is 0 for
/// certain. input_step: k, or k - 1 when delayed.
///
/// Exact for a linear model. Precondition: sets hold authentic packets only, one of a source.
class ClairvoyantFilter : public Estimator, public ToldEstimator {
 public:
  /// Throws UsageError when model, options and rows do not fit.
  ClairvoyantFilter(const SystemModel& model, const ClairvoyantFilterOptions& options,
                    std::vector<std::vector<int>> rows);

  /// Says whether the step that comes next is attacked; holds until said otherwise.
  void tell(const ToldTruth& truth) override { is_attacked_ = truth.has_signal_attack; }

  const Estimate& step(std::int64_t step, const MeasurementSet& measurements,
                       const Eigen::VectorXd& known_input) override;

  /// Packets refused since construction.
  std::int64_t refused_packets() const { return inbox_.refused_packets(); }

 private:
  Gaussian& predict();
  void publish(const Gaussian& belief, std::int64_t step);

  KalmanCore core_;
  PacketInbox inbox_;
  PacketChoice choice_;
  InnovationRecord innovation_;
  Gaussian predicted_, state_, joint_;  // on x, on x, on z
  bool has_started_ = false, is_attacked_ = false, was_attacked_ = false, has_input_ = false;
  Estimate estimate_;
};

}  // namespace holdfast
