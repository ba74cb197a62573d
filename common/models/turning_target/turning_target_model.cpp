#include "common/models/turning_target/turning_target_model.h"

#include <cmath>
#include <numbers>

#include "common/errors.h"

namespace holdfast {
namespace {

constexpr std::size_t kTargetStates = 4, kReadings = 2;

std::vector<double> measurement_variance_of(const TurningTargetOptions& options) {
  if (!options.measurement_variance.empty()) return options.measurement_variance;
  const bool is_radar = options.sensor == TurningTargetOptions::Sensor::kRadar;
  return is_radar ? std::vector<double>{9.0, 0.0025} : std::vector<double>{12.0, 12.0};
}

Eigen::MatrixXd diagonal(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()))
      .asDiagonal();
}

Eigen::MatrixXd turn_matrix(double rate_radps, double step_s) {
  const double angle = rate_radps * step_s;
  const double s = std::sin(angle), c = std::cos(angle);
  // A target that flies straight is the limit: s / w = t, (1 - c) / w = 0.
  const bool is_straight = rate_radps == 0.0;
  const double along = is_straight ? step_s : s / rate_radps;
  const double across = is_straight ? 0.0 : (1.0 - c) / rate_radps;
  Eigen::MatrixXd A(4, 4);
  A << 1.0, 0.0, along, -across, 0.0, 1.0, across, along, 0.0, 0.0, c, -s, 0.0, 0.0, s, c;
  return A;
}

void check(const TurningTargetOptions& options) {
  const auto are_at_least = [](const std::vector<double>& values, double least) {
    for (const double value : values) {
      if (!std::isfinite(value) || value < least) return false;
    }
    return true;
  };
  if (!(options.step_s > 0.0 && std::isfinite(options.turn_rate_degps))) {
    throw UsageError("turning target: step_s must be positive, turn_rate_degps finite");
  }
  if (options.process_variance.size() != kTargetStates ||
      !are_at_least(options.process_variance, 0.0)) {
    throw UsageError("turning target: process_variance must be 4 numbers, none negative");
  }
  if (measurement_variance_of(options).size() != kReadings ||
      !are_at_least(measurement_variance_of(options), 0.0)) {
    throw UsageError("turning target: measurement_variance must be 2 positive numbers");
  }
  if (options.radar_position_m.size() != kReadings) {
    throw UsageError("turning target: radar_position_m must be 2 numbers");
  }
}

void set_radar(const TurningTargetOptions& options, SystemModel& model) {
  const Eigen::Vector2d radar(options.radar_position_m[0], options.radar_position_m[1]);
  model.measurement_names = {"range_m", "bearing_rad"};
  model.measurement = [radar](const Eigen::VectorXd& x, const Eigen::VectorXd&,
                              Eigen::VectorXd& y) {
    y[0] = std::hypot(x[0] - radar[0], x[1] - radar[1]);
    y[1] = std::atan2(x[1] - radar[1], x[0] - radar[0]);
  };
  model.measurement_jacobian = [radar](const Eigen::VectorXd& x, const Eigen::VectorXd&,
                                       Eigen::MatrixXd& J) {
    const double dx = x[0] - radar[0], dy = x[1] - radar[1];
    // On top of the radar neither has a direction: a large slope, not a division by zero.
    const double range = std::max(std::hypot(dx, dy), 1e-9);
    J.setZero();
    J(0, 0) = dx / range;
    J(0, 1) = dy / range;
    J(1, 0) = -dy / (range * range);
    J(1, 1) = dx / (range * range);
  };
  Eigen::MatrixXd J(2, 4);
  model.measurement_jacobian(Eigen::VectorXd::Zero(4), Eigen::VectorXd(), J);
  model.C = J;
}

}  // namespace

void TurningTargetOptions::read(ConfigurationMap& map) {
  map.read("step_s", step_s, kPositive);
  map.read("turn_rate_degps", turn_rate_degps);
  map.read_shared("process_variance", process_variance, kTargetStates, kNonNegative);
  const Sensor before = sensor;
  map.read_choice("sensor", sensor, {{"position", Sensor::kPosition}, {"radar", Sensor::kRadar}});
  if (sensor != before) measurement_variance.clear();
  measurement_variance = measurement_variance_of(*this);
  map.read_shared("measurement_variance", measurement_variance, kReadings, kPositive);
  if (sensor == Sensor::kRadar) map.read("radar_position_m", radar_position_m, kReadings);
}

SystemModel make_turning_target_model(const TurningTargetOptions& options) {
  check(options);
  SystemModel model;
  model.A = turn_matrix(options.turn_rate_degps * std::numbers::pi / 180.0, options.step_s);
  model.C = Eigen::MatrixXd::Identity(2, 4);
  model.G = Eigen::MatrixXd::Zero(4, 0);
  model.H = Eigen::MatrixXd::Zero(2, 0);
  model.Q = diagonal(options.process_variance);
  model.R = diagonal(measurement_variance_of(options));
  model.step_s = options.step_s;
  model.state_names = {"x_m", "y_m", "vx_mps", "vy_mps"};
  model.measurement_names = {"x_m", "y_m"};
  if (options.sensor == TurningTargetOptions::Sensor::kRadar) set_radar(options, model);
  return model;
}

}  // namespace holdfast
