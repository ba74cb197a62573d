#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "common/configuration.h"

namespace holdfast {

/// A target of nearly constant velocity in the plane, watched by binary energy sensors
/// (paper 002: Song, Wang, Wang, Alsaadi, Shan, "Secure Particle Filtering for Cyber-Physical
/// Systems with Binary Sensors under Multiple Attacks").
///
/// State [x position m, x velocity m/s, y position m, y velocity m/s].
struct BinaryTargetModel {
  using State = Eigen::Vector4d;

  /// Two-component Gaussian noise with a heavy tail, eq. (3).
  struct Glint {
    double tail_probability = 0.15;  // beta
    double mean_1 = 0.0, variance_1 = 0.01;
    double mean_2 = 0.0, variance_2 = 0.25;
  };

  /// What happens to a reading before and while it is sent, eqs. (4)-(7); per sensor.
  struct Attack {
    std::vector<double> dos;        // phi: the sensor's input is forced to zero
    std::vector<double> deception;  // varphi: replaced by a uniform draw
    std::vector<double> flip;       // alpha: the bit arrives inverted
    double deception_low = -3.0, deception_high = 3.0;
  };

  /// Prior of the filter at step 0: Gaussian position, speed and heading.
  struct Prior {
    double position_mean_m[2] = {15.0, 20.0};
    double position_std_m = 10.0;
    double speed_mean_mps = 0.5, speed_std_mps = 0.25;
    double heading_mean_rad = 0.64350110879328437, heading_std_rad = 0.52359877559829887;
  };

  double step_s = 1.0;                                  // t
  double process_noise_intensity = 0.002025;            // Xi
  std::vector<std::vector<double>> sensor_positions_m;  // [S x 2]
  double source_power = 4000.0;                         // Upsilon
  double reference_distance_m = 1.0;                    // d0
  double decay_exponent = 2.8;                          // lambda
  double threshold = 0.3;                               // T
  Glint glint;
  Prior prior;

  /// Radio channel after the bus: y = gain * bit + N(0, noise_std^2), eq. (8). Off: y is the bit.
  bool has_radio_channel = false;
  double radio_gain = 0.5;       // tau
  double radio_noise_std = 0.1;  // of epsilon

  std::size_t num_sensors() const { return sensor_positions_m.size(); }

  /// F and Q of eq. (1): blockdiag([1 t; 0 1]) and Xi blockdiag([t^3/3 t^2/2; t^2/2 t]), [4 x 4].
  Eigen::Matrix4d transition() const;
  Eigen::Matrix4d process_noise() const;
  /// F x + w with w = L n, n four standard normals in the order of the state, eq. (1).
  State propagate(const State& state, const Eigen::Vector4d& normals) const;
  /// Entries of the lower Cholesky factor of Xi [t^3/3 t^2/2; t^2/2 t], one axis: l11, l21, l22.
  struct AxisNoise {
    double position = 0.0, cross = 0.0, velocity = 0.0;
  };
  AxisNoise axis_noise() const;

  /// Between target and sensor, m^2.
  double squared_distance(const State& state, std::size_t sensor) const;
  /// h_s(x), eq. (2); +infinity on the sensor itself.
  double energy(const State& state, std::size_t sensor) const;
  /// P(nu > u) and P(nu <= u) of the glint noise.
  double glint_survival(double u) const;
  double glint_distribution(double u) const;

  /// Reads the keys of one map over the values that stand; checks shapes and ranges.
  void read(ConfigurationMap map);

 private:
  void resolve_matrices(ConfigurationMap& map) const;
};

/// Reads "dos", "deception", "flip", "deception_range" over the values that stand.
void read_attack(ConfigurationMap map, std::size_t num_sensors, BinaryTargetModel::Attack& attack,
                 bool with_flip);

}  // namespace holdfast
