#pragma once

#include "common/models/binary_target/binary_target_model.h"
#include "common/random_stream.h"
#include "plant/noise_reach.h"
#include "plant/plant.h"

namespace holdfast {

/// YAML keys below "plant" have these names.
struct BinaryTargetPlantOptions {
  enum class Trajectory { kStraight, kRandom };

  Trajectory trajectory = Trajectory::kRandom;
  std::vector<double> start_state = {15.0, 0.4, 20.0, 0.3};  // [m, m/s, m, m/s]
  BinaryTargetModel::Attack attack;  // what really happens at the sensors; flips belong to the bus

  void read(ConfigurationMap map, std::size_t num_sensors);
};

/// Draws behind an attack at one sensor.
struct SensorAttackDraws {
  double dos_uniform = 1.0;        // DoS when below phi
  double deception_uniform = 1.0;  // deception when below varphi
  double deception_value = 0.0;    // mu
};

/// What an attack at the sensor makes of its bit, paper 002 eqs. (4)-(5).
struct BinaryReading {
  bool is_dos = false, is_deception = false;
  bool bit = false;  // of 0 under DoS, of mu under deception, else the clean one
};
BinaryReading attack_binary_sensor(bool clean_bit, double threshold, double dos, double deception,
                                   const SensorAttackDraws& draws);

/// Target of nearly constant velocity and its binary sensors (paper 002, section II).
///
/// Source s is sensor s; its reading is one bit. Attack signals: "sensor_dos" and
/// "sensor_deception", 1 per sensor where it acted in the step, and "sensor_deception_value".
class BinaryTargetPlant : public Plant {
 public:
  BinaryTargetPlant(const BinaryTargetModel& model, const BinaryTargetPlantOptions& options,
                    std::uint64_t seed, std::uint32_t run);

  const PlantStep& advance() override;
  std::vector<std::string> state_names() const override;

 private:
  bool clean_bit(std::size_t sensor, std::uint32_t step) const;
  SensorAttackDraws draw_attack(std::size_t sensor, std::uint32_t step) const;

  BinaryTargetModel model_;
  NoiseReach reach_;
  BinaryTargetPlantOptions options_;
  RandomStream process_noise_, sensor_noise_, sensor_attack_;
  BinaryTargetModel::State state_;
  PlantStep step_;
};

}  // namespace holdfast
