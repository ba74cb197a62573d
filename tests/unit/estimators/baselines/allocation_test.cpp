#include "common/models/ieee14/ieee14_model.h"
#include "common/models/turning_target/turning_target_model.h"
#include "estimators/kalman_lanes.h"
#include "tests/support/allocation_count.h"
#include "tests/unit/estimators/baselines/every_baseline.h"

using namespace holdfast;
using namespace holdfast::testing;

TEST_CASE("a baseline's step allocates nothing once it has seen the largest set") {
  for (const bool is_direct : {true, false}) {
    for (Subject& subject : every_baseline(small_model(is_direct), kTwoSources)) {
      INFO(subject.name);
      MeasurementSet largest = set_of(1, reading(1), kTwoSources), partial = empty_set(1);
      for (int i = 0; i < 20; ++i) add_packet(largest, i % 2, {0.1 * i, -0.1 * i});
      add_packet(largest, 9, {0.0, 0.0});
      add_packet(partial, 1, {0.3, 0.2});
      const MeasurementSet empty = empty_set(1);
      subject.estimator->step(1, largest, kNoInput);
      const std::int64_t before = allocation_count();
      for (std::int64_t k = 2; k < 40; ++k) {
        subject.estimator->step(k, k % 5 == 0 ? empty : k % 3 == 0 ? partial : largest, kNoInput);
      }
      const std::int64_t after = allocation_count();
      CHECK(after == before);
    }
  }
}

TEST_CASE("a fixed lag allocates nothing once its window is full") {
  const SystemModel model = small_model(true);
  for (const bool is_aircraft : {true, false}) {
    const SystemModel believed =
        is_aircraft ? make_turning_target_model(TurningTargetOptions()) : model;
    const Rows rows = {is_aircraft ? std::vector<int>{0, 1} : std::vector<int>{0, 1, 2, 3}};
    AttackMixtureOptions options;
    options.smoother_passes = 3;
    AttackMixture filter(believed, options, rows);
    filter.remember(5);
    MeasurementSet set = empty_set(1);
    add_packet(set, 0, std::vector<double>(rows[0].size(), 0.3));
    for (std::int64_t k = 1; k < 8; ++k) {
      filter.step(k, set, kNoInput);
      filter.smooth();
    }
    const std::int64_t before = allocation_count();
    for (std::int64_t k = 8; k < 20; ++k) {
      filter.step(k, set, kNoInput);
      filter.smooth();
    }
    const std::int64_t after = allocation_count();
    CHECK(after == before);
  }
}

TEST_CASE("a mixture that learns, and one of sigma points, allocate nothing") {
  const SystemModel position = make_turning_target_model(TurningTargetOptions());
  TurningTargetOptions of_radar;
  of_radar.sensor = TurningTargetOptions::Sensor::kRadar;
  AttackMixtureOptions learns, unscented;
  learns.learn_over_steps = 20.0;
  unscented.linearisation = Linearisation::kUnscented;
  unscented.start.mean = {200.0, 200.0, 15.0, 15.0};
  AttackMixture learning(position, learns, {{0, 1}});
  AttackMixture sigma_points(make_turning_target_model(of_radar), unscented, {{0, 1}});
  for (AttackMixture* filter : {&learning, &sigma_points}) {
    MeasurementSet set = empty_set(1);
    add_packet(set, 0, {200.0, 0.7});
    for (std::int64_t k = 1; k < 4; ++k) filter->step(k, set, kNoInput);
    const double believed = filter->statistics().attack_probability;
    const std::int64_t before = allocation_count();
    for (std::int64_t k = 4; k < 20; ++k) filter->step(k, set, kNoInput);
    const std::int64_t after = allocation_count();
    CHECK(after == before);
    CHECK((filter->statistics().attack_probability != believed) == (filter == &learning));
  }
}

TEST_CASE("filters in lanes allocate nothing") {
  const Gaussian start{Eigen::Vector4d::Zero(), Eigen::Matrix4d::Identity()};
  KalmanLanes<4, 2> lanes(make_turning_target_model(TurningTargetOptions()), start, 7);
  const std::vector<double> readings(14, 0.3);
  std::vector<double> distances(7), densities(7);
  const std::int64_t before = allocation_count();
  bool is_definite = true;
  for (int k = 0; k < 10; ++k) {
    is_definite = lanes.step(readings, distances, densities) && is_definite;
  }
  const std::int64_t after = allocation_count();
  CHECK(is_definite);
  CHECK(after == before);
}

TEST_CASE("steps of the nonlinear network allocate nothing") {
  Ieee14Options network;
  network.nonlinear = true;
  JointInputState filter(make_ieee14_model(network), {}, {{0, 1, 2, 3, 4, 5, 6, 7, 8, 9}});
  MeasurementSet set = empty_set(1);
  add_packet(set, 0, std::vector<double>(10, 0.1));
  filter.step(1, set, kNoInput);
  const std::int64_t before = allocation_count();
  for (std::int64_t k = 2; k < 10; ++k) filter.step(k, set, kNoInput);
  const std::int64_t after = allocation_count();
  CHECK(after == before);
}

TEST_CASE("the counter sees Eigen's allocations") {
  const std::int64_t before = allocation_count();
  Eigen::VectorXd vector(100);
  vector.setZero();
  const std::int64_t after = allocation_count();
  CHECK(after > before);
  CHECK(vector.sum() == 0.0);
}
