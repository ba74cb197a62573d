#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "estimators/estimate.h"

namespace holdfast {

/// How a correction by one vector went.
struct VectorResult {
  enum class Kind {
    kCorrected,
    kSkipped,  // the method saw nothing to learn from the vector, or an attack that hides all
    kFailed    // an innovation covariance could not be factorised; the prediction stands
  };

  Kind kind = Kind::kFailed;
  double squared_distance = 0.0;  // nu' S^-1 nu, by the method's one Gaussian for the reading
  double log_density = 0.0;       // of the vector
};

/// The arithmetic of a filter with one Gaussian, in whatever sizes it was compiled for. One step:
/// begin_step, observe unless nothing arrived, distance as often as wanted, correct, end_step.
class VectorKernel {
 public:
  virtual ~VectorKernel() = default;

  /// Moves the belief to this step; the first one only where the start is at step 0.
  virtual void begin_step(std::int64_t step, bool has_to_move) = 0;
  /// h and its moments at the prediction.
  virtual void observe() = 0;
  /// nu' S^-1 nu of some rows of y; not finite when S is not positive definite.
  virtual double distance(std::span<const int> rows, std::span<const double> values) = 0;
  virtual VectorResult correct(std::span<const int> rows, std::span<const double> values) = 0;
  /// Keeps the step for the smoother, if it is to remember any.
  virtual void end_step() = 0;

  /// Mean, covariance, and what else the method says.
  virtual void publish(Estimate& estimate) const = 0;
  /// Innovation and covariance of the latest correct(): of the rows given to it, in their order.
  virtual void publish_innovation(Eigen::VectorXd& nu, Eigen::MatrixXd& S) const = 0;

  virtual void remember(std::size_t num_steps) = 0;
  /// Smooths all steps that are remembered.
  virtual void smooth() = 0;
  /// Mean and covariance of the i-th remembered step, oldest first, after smooth().
  virtual void publish_smoothed(std::size_t i, Estimate& estimate) const = 0;
};

}  // namespace holdfast
