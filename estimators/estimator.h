#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "common/measurement_set.h"
#include "estimators/estimate.h"

namespace holdfast {

/// The one interface of every method: measurement sets in, estimates out.
///
/// One thread. Reads no clock and no global state; its randomness comes from named streams that
/// it was built with, so the same sets give the same estimates, to the bit.
class Estimator {
 public:
  virtual ~Estimator() = default;

  /// Takes one step. Precondition: step = that of the previous call + 1, from 1.
  /// known_input: u_k [m], empty when the plant has none. A non-finite value is left out, and the
  /// outcome says so. The reference holds until the next call. Allocates nothing in steady state.
  virtual const Estimate& step(std::int64_t step, const MeasurementSet& measurements,
                               const Eigen::VectorXd& known_input) = 0;
};

}  // namespace holdfast
