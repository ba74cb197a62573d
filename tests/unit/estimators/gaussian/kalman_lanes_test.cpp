// Many runs in lanes are the same runs one by one.

#include "estimators/kalman_lanes.h"

#include <limits>
#include <memory>
#include <vector>

#include "tests/unit/estimators/gaussian/attack_cases.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

constexpr int kLaneSteps = 30;

SystemModel random_model(int n, int l) {
  const RandomStream stream(3, 0, "test/lanes_model");
  SystemModel model;
  model.A = 0.9 * Eigen::MatrixXd::Identity(n, n);
  model.C = Eigen::MatrixXd::Zero(l, n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const auto draw = static_cast<std::uint64_t>(i * n + j);
      model.A(i, j) += 0.05 * stream.normal(1, draw);
      if (i < l) model.C(i, j) = stream.normal(2, draw);
    }
  }
  model.G = Eigen::MatrixXd::Zero(n, 0);
  model.H = Eigen::MatrixXd::Zero(l, 0);
  model.Q = 0.01 * Eigen::MatrixXd::Identity(n, n);
  model.R = 0.1 * Eigen::MatrixXd::Identity(l, l);
  return model;
}

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

// Checks every number of every step of both.
template <int N, int L>
void check_equal(const SystemModel& model, std::size_t num_runs) {
  Gaussian start{Eigen::VectorXd::LinSpaced(N, 1.0, 2.0), 4.0 * Eigen::MatrixXd::Identity(N, N)};
  KalmanLanes<N, L> lanes(model, start, num_runs);
  const auto kernels = kernels_of(model, start, num_runs);
  const RandomStream stream(4, 0, "test/lanes_readings");
  std::vector<double> readings(L * num_runs), distances(num_runs), densities(num_runs), y(L);
  std::vector<int> rows(L);
  for (int row = 0; row < L; ++row) rows[static_cast<std::size_t>(row)] = row;
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
      REQUIRE(result.squared_distance == distances[run]);
      REQUIRE(result.log_density == densities[run]);
      for (int i = 0; i < N; ++i) REQUIRE(estimate.mean[i] == lanes.means(i)[run]);
      REQUIRE(estimate.covariance == lanes.covariance());
    }
  }
}

}  // namespace

TEST_CASE("filters in lanes are the filters of each run, to the bit") {
  for (const std::size_t num_runs : {1U, 3U, 4U, 9U}) {
    CAPTURE(num_runs);
    check_equal<4, 2>(aircraft(), num_runs);
    check_equal<12, 12>(random_model(12, 12), num_runs);
  }
}

TEST_CASE("filters in lanes of other sizes are those of Eigen's products but for rounding") {
  const SystemModel model = random_model(8, 4);
  const Gaussian start{Eigen::VectorXd::Ones(8), Eigen::MatrixXd::Identity(8, 8)};
  KalmanLanes<8, 4> lanes(model, start, 5);
  const auto kernels = kernels_of(model, start, 5);  // of sizes that are not compiled
  std::vector<double> readings(20), distances(5), densities(5);
  const RandomStream stream(4, 0, "test/lanes_others");
  Estimate estimate;
  for (std::uint32_t step = 1; step <= kLaneSteps; ++step) {
    for (std::size_t i = 0; i < readings.size(); ++i) readings[i] = stream.normal(step, i);
    REQUIRE(lanes.step(readings, distances, densities));
    for (std::size_t run = 0; run < 5; ++run) {
      const std::vector<double> y = {readings[run], readings[5 + run], readings[10 + run],
                                     readings[15 + run]};
      kernels[run]->begin_step(step, true);
      kernels[run]->observe();
      const VectorResult result = kernels[run]->correct(std::vector<int>{0, 1, 2, 3}, y);
      kernels[run]->publish(estimate);
      CHECK(std::abs(result.log_density - densities[run]) <
            1e-11 * (1.0 + std::abs(densities[run])));
      for (int i = 0; i < 8; ++i) {
        CHECK(std::abs(estimate.mean[i] - lanes.means(i)[run]) < 1e-12);
      }
    }
  }
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
