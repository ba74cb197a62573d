#include "estimators/estimator_session.h"

#include <cmath>

namespace holdfast {

void EstimatorSession::on_set(const MeasurementSet& set, const OnEstimate& on_estimate) {
  // A forged step number must not make the session run through a billion missing ones.
  if (set.step < 1 || set.step > num_steps_) {
    ++counters_.beyond_end;
    return;
  }
  if (set.step <= step_) {
    ++counters_.old_sets;
    return;
  }
  while (step_ + 1 < set.step) {
    missing_.clear(step_ + 1, std::llround(static_cast<double>(step_ + 1) * step_s_ * 1e6));
    missing_.seq = -1;
    ++counters_.missing_steps;
    take(step_ + 1, missing_, on_estimate);
  }
  take(set.step, set, on_estimate);
}

void EstimatorSession::take(std::int64_t step, const MeasurementSet& set,
                            const OnEstimate& on_estimate) {
  step_ = step;
  ++counters_.steps;
  if (known_input_of_) known_input_ = known_input_of_(step);
  on_estimate(estimator_.step(step, set, known_input_));
}

}  // namespace holdfast
