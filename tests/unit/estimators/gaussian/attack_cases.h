#pragma once

#include "common/models/turning_target/turning_target_model.h"
#include "estimators/attack_mixture.h"
#include "estimators/gslr.h"
#include "estimators/kalman_filter.h"
#include "tests/unit/estimators/baselines/baseline_cases.h"

namespace holdfast::testing {

/// Attacks of the paper's aircraft.
inline AttackAssumptions aircraft_attacks() {
  AttackAssumptions assumes;
  assumes.periods.front().bias = {{0.7, 0.9}, {1.0}, {{1.0, 0.0}, {0.0, 0.5}}};
  assumes.periods.front().scale_mean = 0.95;
  return assumes;
}

/// No attack at all.
inline AttackAssumptions no_attacks(AttackAssumptions assumes = aircraft_attacks()) {
  assumes.periods.front().attack_probability = 0.0;
  return assumes;
}

template <class Options>
Options with_start(Options options) {
  options.start = {{200.0, 190.0, 14.0, 16.0}, {}, {}};
  options.start.std = {10.0, 10.0, 4.0, 4.0};
  return options;
}

inline GslrOptions gslr_options(const AttackAssumptions& assumes,
                                RegressionMoments moments = RegressionMoments::kExact) {
  GslrOptions options = with_start(GslrOptions());
  options.assumes = assumes;
  options.moments = moments;
  return options;
}

inline AttackMixtureOptions mixture_options(const AttackAssumptions& assumes, int passes = 3) {
  AttackMixtureOptions options = with_start(AttackMixtureOptions());
  options.assumes = assumes;
  options.smoother_passes = passes;
  return options;
}

inline const Rows kPosition = {{0, 1}};

inline SystemModel aircraft() {
  return make_turning_target_model(TurningTargetOptions());
}

inline SystemModel radar() {
  TurningTargetOptions options;
  options.sensor = TurningTargetOptions::Sensor::kRadar;
  return make_turning_target_model(options);
}

/// Readings of an aircraft that nobody attacks.
inline std::vector<Eigen::VectorXd> aircraft_readings(const SystemModel& model, int steps,
                                                      std::uint32_t run = 0) {
  const Gaussian start = with_start(GslrOptions()).start.gaussian(4);
  const RandomStream stream(5, run, "test/aircraft");
  Eigen::VectorXd x = sample(start, stream, 0, 0), next(4), y(2);
  const Eigen::VectorXd none;
  std::vector<Eigen::VectorXd> readings;
  for (int k = 1; k <= steps; ++k) {
    const auto step = static_cast<std::uint32_t>(k);
    model.measure(x, none, y);
    readings.push_back(y + sample(centred(model.R), stream, step, 100));
    model.move(x, none, next);
    x = next + sample(centred(model.Q), stream, step, 200);
  }
  return readings;
}

}  // namespace holdfast::testing
