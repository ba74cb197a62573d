// Many runs in lanes are the same runs one by one.

#include "estimators/kalman_lanes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <vector>

#include "tests/support/dense_model.h"
#include "tests/unit/estimators/gaussian/attack_cases.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

constexpr int kLaneSteps = 30;

// A kernel for each run.
std::vector<std::unique_ptr<VectorKernel>> kernels_of(const SystemModel& model,
                                                      const Gaussian& start, std::size_t num_runs) {
  KalmanFilterOptions options;
  options.start.mean.assign(start.mean.begin(), start.mean.end());
  const Eigen::VectorXd start_std = start.covariance.diagonal().cwiseSqrt();
  options.start.std.assign(start_std.begin(), start_std.end());
  std::vector<std::unique_ptr<VectorKernel>> kernels;
  for (std::size_t run = 0; run < num_runs; ++run) kernels.push_back(make_kernel(model, options));
  return kernels;
}

// Checks every number of every step of both: the same to the bit (tolerance 0), or relative to 1 or
// the number.
template <int N, int L>
void check_equal(const SystemModel& model, std::size_t num_runs, double tolerance) {
  const Gaussian start{Eigen::VectorXd::LinSpaced(N, 1.0, 2.0),
                       4.0 * Eigen::MatrixXd::Identity(N, N)};
  KalmanLanes<N, L> lanes(model, start, num_runs);
  const auto kernels = kernels_of(model, start, num_runs);
  const auto is_same = [tolerance](double ours, double theirs) {
    return std::abs(ours - theirs) <= tolerance * std::max(1.0, std::abs(theirs));
  };
  const RandomStream stream(4, 0, "test/lanes_readings");
  std::vector<double> readings(L * num_runs), distances(num_runs), densities(num_runs), y(L);
  std::vector<int> rows(L);
  std::iota(rows.begin(), rows.end(), 0);
  Estimate estimate;
  for (std::uint32_t step = 1; step <= kLaneSteps; ++step) {
    for (std::size_t i = 0; i < readings.size(); ++i) readings[i] = stream.normal(step, i);
    REQUIRE(lanes.step(readings, distances, densities));
    for (std::size_t run = 0; run < num_runs; ++run) {
      for (std::size_t row = 0; row < L; ++row) y[row] = readings[row * num_runs + run];
      VectorKernel& kernel = *kernels[run];
      kernel.begin_step(step, true);
      kernel.observe();
      const VectorResult result = kernel.correct(rows, y);
      kernel.end_step();
      kernel.publish(estimate);
      REQUIRE(is_same(distances[run], result.squared_distance));
      REQUIRE(is_same(densities[run], result.log_density));
      for (int i = 0; i < N; ++i) REQUIRE(is_same(lanes.means(i)[run], estimate.mean[i]));
      for (Eigen::Index i = 0; i < N * N; ++i) {
        REQUIRE(is_same(lanes.covariance().data()[i], estimate.covariance.data()[i]));
      }
    }
  }
}

}  // namespace

TEST_CASE("filters in lanes are the filters of each run, to the bit") {
  for (const std::size_t num_runs : {1U, 3U, 4U, 9U}) {
    CAPTURE(num_runs);
    check_equal<4, 2>(aircraft(), num_runs, 0.0);
    check_equal<12, 12>(dense_model(12, 12), num_runs, 0.0);
  }
}

TEST_CASE("filters in lanes of other sizes are those of Eigen's products but for rounding") {
  check_equal<8, 4>(dense_model(8, 4), 5, 1e-11);
  check_equal<16, 8>(dense_model(16, 8), 3, 1e-11);
}

TEST_CASE("filters in lanes: no update without a definite innovation covariance, wrong models") {
  const SystemModel model = aircraft();
  const Gaussian certain{Eigen::Vector4d(1, 2, 3, 4), Eigen::Matrix4d::Zero()};
  const Gaussian broken{certain.mean, -1e6 * Eigen::Matrix4d::Identity()};
  KalmanLanes<4, 2> lanes(model, broken, 3);
  std::vector<double> readings(6, 7.0), distances(3), densities(3);
  CHECK_FALSE(lanes.step(readings, distances, densities));
  const Eigen::Vector4d predicted = model.A * certain.mean;
  for (int i = 0; i < 4; ++i) {
    for (const double mean : lanes.means(i)) CHECK(mean == Approx(predicted[i]));
  }

  // A reading that is no number spoils its own run only.
  KalmanLanes<4, 2> honest(model, certain, 3);
  readings[1] = std::numeric_limits<double>::quiet_NaN();
  REQUIRE(honest.step(readings, distances, densities));
  CHECK(std::isnan(honest.means(0)[1]));
  CHECK(std::isfinite(honest.means(0)[0]));
  CHECK(std::isfinite(honest.means(0)[2]));

  CHECK_THROWS_AS((KalmanLanes<4, 2>(radar(), certain, 3)), UsageError);
  CHECK_THROWS_AS((KalmanLanes<8, 4>(model, certain, 3)), UsageError);
}
