#include "estimators/vector_correction.h"

#include <utility>

namespace holdfast {

VectorCorrection::VectorCorrection(std::vector<std::vector<int>> rows, int num_measurements,
                                   const VectorOptions& options)
    : inbox_(std::move(rows), num_measurements),
      choice_(options.packet, options.gate_probability, inbox_),
      innovation_(num_measurements) {}

PacketChoice::Result VectorCorrection::step(std::int64_t step, const MeasurementSet& measurements,
                                            KalmanCore& core, Gaussian& belief,
                                            Estimate& estimate) {
  inbox_.read(measurements);
  inbox_.begin(step, measurements, estimate);
  if (has_started_) core.predict(belief);
  has_started_ = true;
  KalmanMode mode{&core, &belief};
  const PacketChoice::Result result = choice_.correct(inbox_, {&mode, 1}, estimate);
  innovation_.clear(estimate);
  if (result == PacketChoice::Result::kCorrected) {
    innovation_.publish(core.innovation(), core.innovation_covariance(), estimate);
    distance_ = mode.distance;
  }
  return result;
}

}  // namespace holdfast
