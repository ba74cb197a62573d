#include "common/models/binary_target/binary_target_model.h"

#include <cmath>
#include <numbers>

namespace holdfast {

BinaryTargetModel::AxisNoise BinaryTargetModel::axis_noise() const {
  const double t = step_s;
  const double scale = std::sqrt(process_noise_intensity);
  const double position = scale * std::sqrt(t * t * t / 3.0);
  if (position == 0.0) return {};
  const double cross = process_noise_intensity * t * t / 2.0 / position;
  return {position, cross, std::sqrt(process_noise_intensity * t - cross * cross)};
}

BinaryTargetModel::State BinaryTargetModel::propagate(const State& state,
                                                      const Eigen::Vector4d& normals) const {
  const AxisNoise noise = axis_noise();
  State next = state;
  for (const int axis : {0, 2}) {
    next[axis] += step_s * state[axis + 1] + noise.position * normals[axis];
    next[axis + 1] += noise.cross * normals[axis] + noise.velocity * normals[axis + 1];
  }
  return next;
}

double BinaryTargetModel::squared_distance(const State& state, std::size_t sensor) const {
  const auto& position = sensor_positions_m[sensor];
  const double dx = state[0] - position[0];
  const double dy = state[2] - position[1];
  return dx * dx + dy * dy;
}

double BinaryTargetModel::energy(const State& state, std::size_t sensor) const {
  const double d0_squared = reference_distance_m * reference_distance_m;
  return source_power *
         std::pow(squared_distance(state, sensor) / d0_squared, -0.5 * decay_exponent);
}

namespace {

double upper_tail(double u, double mean, double variance) {
  return 0.5 * std::erfc((u - mean) / std::sqrt(2.0 * variance));
}

}  // namespace

double BinaryTargetModel::glint_survival(double u) const {
  return (1.0 - glint.tail_probability) * upper_tail(u, glint.mean_1, glint.variance_1) +
         glint.tail_probability * upper_tail(u, glint.mean_2, glint.variance_2);
}

double BinaryTargetModel::glint_distribution(double u) const {
  return (1.0 - glint.tail_probability) * upper_tail(-u, -glint.mean_1, glint.variance_1) +
         glint.tail_probability * upper_tail(-u, -glint.mean_2, glint.variance_2);
}

Eigen::Matrix4d BinaryTargetModel::transition() const {
  Eigen::Matrix4d F = Eigen::Matrix4d::Identity();
  F(0, 1) = F(2, 3) = step_s;
  return F;
}

Eigen::Matrix4d BinaryTargetModel::process_noise() const {
  const double t = step_s;
  Eigen::Matrix2d axis;
  axis << t * t * t / 3.0, t * t / 2.0, t * t / 2.0, t;
  Eigen::Matrix4d Q = Eigen::Matrix4d::Zero();
  Q.topLeftCorner<2, 2>() = Q.bottomRightCorner<2, 2>() = process_noise_intensity * axis;
  return Q;
}

// A reader in any language finds the numbers in the resolved scenario. They follow from step and
// intensity, so a file that gives others contradicts itself.
void BinaryTargetModel::resolve_matrices(ConfigurationMap& map) const {
  ConfigurationMap matrices = map.map("matrices");
  for (const auto& [key, matrix] :
       {std::pair{"F", transition()}, std::pair{"Q", process_noise()}}) {
    std::vector<std::vector<double>> derived(4, std::vector<double>(4));
    for (int row = 0; row < 4; ++row) {
      for (int column = 0; column < 4; ++column) {
        derived[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)] =
            matrix(row, column);
      }
    }
    std::vector<std::vector<double>> given = derived;
    matrices.read(key, given, 4);
    if (given != derived) {
      matrices.problem(key, "follows from step_s and process_noise_intensity: leave it out");
    }
  }
}

void BinaryTargetModel::read(ConfigurationMap map) {
  map.read("step_s", step_s, kPositive);
  map.read("process_noise_intensity", process_noise_intensity, kNonNegative);
  map.read("sensor_positions_m", sensor_positions_m, 2);
  if (sensor_positions_m.empty())
    map.problem("sensor_positions_m", "at least one sensor is needed");
  map.read("source_power", source_power, kNonNegative);
  map.read("reference_distance_m", reference_distance_m, kPositive);
  map.read("decay_exponent", decay_exponent, kPositive);
  map.read("threshold", threshold);

  resolve_matrices(map);

  ConfigurationMap glint_map = map.map("glint");
  glint_map.read("tail_probability", glint.tail_probability, kProbability);
  glint_map.read("mean_1", glint.mean_1);
  glint_map.read("variance_1", glint.variance_1, kPositive);
  glint_map.read("mean_2", glint.mean_2);
  glint_map.read("variance_2", glint.variance_2, kPositive);

  ConfigurationMap prior_map = map.map("prior");
  std::vector<double> position(prior.position_mean_m, prior.position_mean_m + 2);
  prior_map.read("position_mean_m", position, 2);
  if (position.size() == 2) std::copy(position.begin(), position.end(), prior.position_mean_m);
  prior_map.read("position_std_m", prior.position_std_m, kNonNegative);
  prior_map.read("speed_mean_mps", prior.speed_mean_mps);
  prior_map.read("speed_std_mps", prior.speed_std_mps, kNonNegative);
  prior_map.read("heading_mean_rad", prior.heading_mean_rad);
  prior_map.read("heading_std_rad", prior.heading_std_rad, kNonNegative);

  ConfigurationMap radio = map.map("radio_channel");
  radio.read("enabled", has_radio_channel);
  radio.read("gain", radio_gain);
  radio.read("noise_std", radio_noise_std, kPositive);
}

void read_attack(ConfigurationMap map, std::size_t num_sensors, BinaryTargetModel::Attack& attack,
                 bool with_flip) {
  const auto size_to = [num_sensors](std::vector<double>& values) {
    if (values.size() != num_sensors) values.assign(num_sensors, 0.0);
  };
  size_to(attack.dos);
  size_to(attack.deception);
  size_to(attack.flip);
  map.read_shared("dos", attack.dos, num_sensors, kProbability);
  map.read_shared("deception", attack.deception, num_sensors, kProbability);
  if (with_flip) map.read_shared("flip", attack.flip, num_sensors, kProbability);
  std::vector<double> range = {attack.deception_low, attack.deception_high};
  map.read("deception_range", range, 2);
  if (range.size() == 2 && range[0] < range[1]) {
    attack.deception_low = range[0];
    attack.deception_high = range[1];
  } else {
    map.problem("deception_range", "must be [low, high] with low < high");
  }
}

}  // namespace holdfast
