#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "common/measurement_set.h"
#include "common/models/system_model.h"
#include "common/random_stream.h"
#include "estimators/baseline_options.h"
#include "estimators/estimator.h"
#include "estimators/kalman_core.h"
#include "tests/support/catch.h"

namespace holdfast::testing {

inline const Eigen::VectorXd kNoInput;
using Rows = std::vector<std::vector<int>>;
inline const Rows kOneSource = {{0, 1, 2, 3}};
inline const Rows kTwoSources = {{0, 1}, {2, 3}};

/// Three states, four readings, two attack channels; every matrix full, Q and R correlated.
SystemModel small_model(bool has_feedthrough);

/// Where filters of the small model start, and what they think of its attack.
inline const GaussianOptions kStartOptions = {{1.0, -1.0, 0.5}, {0.7}, {}};
inline const GaussianOptions kPriorOptions = {{1.0, -1.0}, {3.0}, {}};
inline const Gaussian kStart = kStartOptions.gaussian(3);
inline const Gaussian kPrior = kPriorOptions.gaussian(2);

/// The same model by functions, so that the extended filter's path is taken.
SystemModel as_functions(const SystemModel& linear);

void add_packet(MeasurementSet& set, int source, const std::vector<double>& values,
                std::int64_t rx_index = -1);

std::vector<double> part_of(const Eigen::VectorXd& y, const std::vector<int>& rows);

MeasurementSet empty_set(std::int64_t step);

MeasurementSet set_of(std::int64_t step, const Eigen::VectorXd& y, const Rows& rows);

Eigen::VectorXd sample(const Gaussian& gaussian, const RandomStream& stream, std::uint32_t step,
                       std::uint64_t first_draw);

Gaussian centred(const Eigen::MatrixXd& covariance);

/// One path of a linear model: x_1 ~ start, a_k ~ prior in attacked steps and 0 in others.
struct Path {
  std::vector<Eigen::VectorXd> x, a, y;  // [k - 1]

  Path(const SystemModel& model, const Gaussian& start, const Gaussian& prior,
       const std::vector<bool>& attacked, std::uint32_t run);
};

/// All of a step's readings.
MeasurementSet set_at(const Path& path, int step, const Rows& rows = kOneSource);

/// The other route: all of x_1, w, a and v as one Gaussian, conditioned on all readings at once.
class Batch {
 public:
  Batch(const SystemModel& model, const Gaussian& start, const Gaussian& prior,
        const std::vector<bool>& attacked);

  void observe(int step, const std::vector<int>& rows, const Eigen::VectorXd& y);

  /// Posterior of [x_step; a_input_step]; input_step 0: of x alone.
  Gaussian posterior(int step, int input_step = 0) const;

  /// log p(all readings).
  double log_likelihood() const;

 private:
  Eigen::MatrixXd all_observed() const;
  Eigen::VectorXd innovation(const Eigen::MatrixXd& Y) const;

  SystemModel model_;
  int steps_;
  Eigen::VectorXd mean_;
  Eigen::MatrixXd covariance_;
  std::vector<Eigen::MatrixXd> states_, inputs_, readings_;
  std::vector<Eigen::RowVectorXd> observed_;
  std::vector<double> values_;
};

/// Largest difference of two matrices, over the scale of the second when that is above 1.
double difference(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

double difference(const Estimate& estimate, const Gaussian& wanted);

/// (x - mean)' P^-1 (x - mean).
double nees(const Eigen::VectorXd& x, const Eigen::VectorXd& mean,
            const Eigen::MatrixXd& covariance);

}  // namespace holdfast::testing
