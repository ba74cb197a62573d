#pragma once

#include <cstdint>
#include <functional>
#include <utility>

#include "estimators/estimator.h"

namespace holdfast {

/// What happened to the sets that a session was given.
struct SessionCounters {
  std::int64_t steps = 0;  // taken, missing ones included
  std::int64_t missing_steps =
      0;                        // sets that never came; the estimator took the step without packets
  std::int64_t old_sets = 0;    // of a step that was taken already; ignored
  std::int64_t beyond_end = 0;  // step above the scenario's last or below 1; ignored
};

/// Feeds an estimator with consecutive steps, whatever the transport lost or repeated. Pure.
class EstimatorSession {
 public:
  /// Called once per step taken, with the estimate.
  using OnEstimate = std::function<void(const Estimate&)>;

  /// u of a step.
  using KnownInput = std::function<Eigen::VectorXd(std::int64_t step)>;

  /// utime of a missing step is interpolated: step * step_s. No function: no known input.
  EstimatorSession(Estimator& estimator, std::int64_t num_steps, double step_s,
                   KnownInput known_input = {})
      : estimator_(estimator),
        num_steps_(num_steps),
        step_s_(step_s),
        known_input_of_(std::move(known_input)) {}

  void on_set(const MeasurementSet& set, const OnEstimate& on_estimate);

  bool is_finished() const { return step_ >= num_steps_; }
  std::int64_t step() const { return step_; }
  const SessionCounters& counters() const { return counters_; }

 private:
  void take(std::int64_t step, const MeasurementSet& set, const OnEstimate& on_estimate);

  Estimator& estimator_;
  std::int64_t num_steps_;
  double step_s_;
  KnownInput known_input_of_;
  std::int64_t step_ = 0;
  MeasurementSet missing_;
  Eigen::VectorXd known_input_;
  SessionCounters counters_;
};

}  // namespace holdfast
