#pragma once

#include <vector>

#include "common/configuration.h"
#include "common/models/system_model.h"

namespace holdfast {

/// Keys of a plant or belief with an aircraft in a coordinated turn, of paper 001.
struct TurningTargetOptions {
  enum class Sensor {
    kPosition,  // y = [x, y], m
    kRadar      // y = [range, bearing] from radar_position_m, m and rad
  };

  double step_s = 0.05;
  double turn_rate_degps = 3.0;                                         // omega, known
  std::vector<double> process_variance = {0.09, 0.09, 0.0025, 0.0025};  // diagonal of Q, [4]
  Sensor sensor = Sensor::kPosition;
  std::vector<double> measurement_variance;  // diagonal of R, [2]; empty: the sensor's default
  std::vector<double> radar_position_m = {150.0, 450.0};

  void read(ConfigurationMap& map);
};

/// Coordinated turn of known rate omega, state [x, y, vx, vy] in m and m/s, t = step_s:
///
///   A = [1 0 s/w -(1-c)/w; 0 1 (1-c)/w s/w; 0 0 c -s; 0 0 s c],  s, c = sin, cos(w t)
///
/// Radar: h = [hypot(d), atan2(d_y, d_x)], d = [x, y] - radar. Bearings are not wrapped: one that
/// an attacker scaled is no angle, so the target should stay on one side of the radar's cut at pi.
/// There is no attack channel: attacks on this plant act on its frames.
/// Throws UsageError for a number of a wrong size or sign.
SystemModel make_turning_target_model(const TurningTargetOptions& options);

}  // namespace holdfast
