#include "plant/binary_target_plant.h"

#include <cmath>

namespace holdfast {

void BinaryTargetPlantOptions::read(ConfigurationMap map, std::size_t num_sensors) {
  map.read_choice("trajectory", trajectory,
                  {{"straight", Trajectory::kStraight}, {"random", Trajectory::kRandom}});
  map.read("start_state", start_state, 4);
  read_attack(map.map("attack"), num_sensors, attack, false);
}

BinaryReading attack_binary_sensor(bool clean_bit, double threshold, double dos, double deception,
                                   const SensorAttackDraws& draws) {
  BinaryReading reading;
  reading.is_dos = draws.dos_uniform < dos;
  reading.is_deception = !reading.is_dos && draws.deception_uniform < deception;
  reading.bit = reading.is_dos         ? 0.0 > threshold
                : reading.is_deception ? draws.deception_value > threshold
                                       : clean_bit;
  return reading;
}

BinaryTargetPlant::BinaryTargetPlant(const BinaryTargetModel& model,
                                     const BinaryTargetPlantOptions& options, std::uint64_t seed,
                                     std::uint32_t run)
    : model_(model),
      reach_(model),
      options_(options),
      process_noise_(seed, run, "plant/process_noise"),
      sensor_noise_(seed, run, "plant/sensor_noise"),
      sensor_attack_(seed, run, "plant/sensor_attack"),
      state_(options.start_state.data()) {
  const std::size_t num_sensors = model_.num_sensors();
  step_.state = state_;
  step_.readings.assign(num_sensors, {0.0});
  step_.clean_readings.assign(num_sensors, {0.0});
  for (const char* name : {"sensor_dos", "sensor_deception", "sensor_deception_value"}) {
    step_.attack_signals.push_back({name, std::vector<double>(num_sensors, 0.0)});
  }
}

// Draws are addressed, so those that nothing could depend on are left out.
bool BinaryTargetPlant::clean_bit(std::size_t sensor, std::uint32_t step) const {
  const auto& glint = model_.glint;
  const bool is_tail = sensor_noise_.uniform(step, 4 * sensor) < glint.tail_probability;
  // Normal draw 4 s + 2 uses the words of uniforms 4 s + 2 and 4 s + 3 only, so the two never
  // share.
  const std::array<double, 2> uniforms = sensor_noise_.uniforms(step, 2 * sensor + 1);
  const std::optional<bool> settled =
      reach_.settled_bit(model_.squared_distance(state_, sensor), is_tail, uniforms[0]);
  if (settled) return *settled;
  const double normal = RandomStream::normal_of(uniforms);
  const double noise = is_tail ? glint.mean_2 + std::sqrt(glint.variance_2) * normal
                               : glint.mean_1 + std::sqrt(glint.variance_1) * normal;
  return model_.energy(state_, sensor) + noise > model_.threshold;
}

SensorAttackDraws BinaryTargetPlant::draw_attack(std::size_t sensor, std::uint32_t step) const {
  SensorAttackDraws draws;
  const BinaryTargetModel::Attack& attack = options_.attack;
  if (attack.dos[sensor] > 0.0 || attack.deception[sensor] > 0.0) {
    const auto [dos_uniform, deception_uniform] = sensor_attack_.uniforms(step, 2 * sensor);
    draws.dos_uniform = dos_uniform;
    draws.deception_uniform = deception_uniform;
  }
  if (draws.deception_uniform < attack.deception[sensor]) {
    const double position = sensor_attack_.uniform(step, 4 * sensor + 2);
    draws.deception_value =
        attack.deception_low + (attack.deception_high - attack.deception_low) * position;
  }
  return draws;
}

const PlantStep& BinaryTargetPlant::advance() {
  ++step_.step;
  const auto step = static_cast<std::uint32_t>(step_.step);
  Eigen::Vector4d normals = Eigen::Vector4d::Zero();
  if (options_.trajectory == BinaryTargetPlantOptions::Trajectory::kRandom) {
    for (int pair = 0; pair < 2; ++pair) {
      const auto [first, second] = process_noise_.normals(step, static_cast<std::uint64_t>(pair));
      normals[2 * pair] = first;
      normals[2 * pair + 1] = second;
    }
  }
  state_ = model_.propagate(state_, normals);
  step_.state = state_;
  for (std::size_t s = 0; s < model_.num_sensors(); ++s) {
    const bool clean = clean_bit(s, step);
    const SensorAttackDraws draws = draw_attack(s, step);
    const BinaryReading reading = attack_binary_sensor(
        clean, model_.threshold, options_.attack.dos[s], options_.attack.deception[s], draws);
    step_.readings[s][0] = reading.bit ? 1.0 : 0.0;
    step_.clean_readings[s][0] = clean ? 1.0 : 0.0;
    step_.attack_signals[0].value[s] = reading.is_dos ? 1.0 : 0.0;
    step_.attack_signals[1].value[s] = reading.is_deception ? 1.0 : 0.0;
    step_.attack_signals[2].value[s] = reading.is_deception ? draws.deception_value : 0.0;
  }
  return step_;
}

std::vector<std::string> BinaryTargetPlant::state_names() const {
  return {"x_position_m", "x_velocity_mps", "y_position_m", "y_velocity_mps"};
}

}  // namespace holdfast
