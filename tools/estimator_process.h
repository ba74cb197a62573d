#pragma once

#include <functional>
#include <holdfast/estimate_t.hpp>
#include <holdfast/measurement_set_t.hpp>
#include <holdfast/timing_t.hpp>
#include <memory>
#include <optional>
#include <string>

#include "common/status.h"
#include "estimators/estimator_session.h"
#include "estimators/smoothed_stream.h"
#include "tools/experiment.h"

namespace holdfast {

/// What holdfast-estimator does live: MEASUREMENT in, EST_<NAME> and TIMING_<NAME> out, and
/// SMOOTHED_<NAME> where the scenario wants a fixed lag.
class EstimatorProcess {
 public:
  /// Subscribes at once. Throws UsageError for an estimator that cannot run live.
  EstimatorProcess(const Experiment& experiment, const EstimatorEntry& entry, LcmLink& link);

  /// Called after the scenario's last step.
  void on_finished(std::function<void()> callback) { on_finished_ = std::move(callback); }
  void set_state(ProcessState state) { status_.set_state(state); }
  void publish_status();

 private:
  void on_set(const measurement_set_t& received);
  void publish(const Estimate& estimate);
  void publish_smoothed();

  LcmLink& link_;
  StatusReporter status_;
  std::unique_ptr<Estimator> estimator_;
  EstimatorSession session_;
  std::string estimate_channel_, timing_channel_, smoothed_channel_;
  std::optional<SmoothedStream> smoothed_;  // with a fixed lag
  std::function<void()> on_finished_;
  MeasurementSet set_;
  std::int64_t started_ns_ = 0;
  estimate_t message_;
  timing_t timing_;
};

}  // namespace holdfast
