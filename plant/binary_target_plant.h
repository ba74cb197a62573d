#pragma once

#include "common/models/binary_target/binary_target_model.h"
#include "common/random_stream.h"
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

/// Draws behind one reading of one sensor.
struct BinarySensorDraws {
  double noise = 0.0;              // nu, glint noise
  double dos_uniform = 1.0;        // DoS when below phi
  double deception_uniform = 1.0;  // deception when below varphi
  double deception_value = 0.0;    // mu
};

/// One binary reading, paper 002 eqs. (2)-(5): attack at the sensor, then the strict threshold.
struct BinaryReading {
  double sensed = 0.0;    // h + nu
  double attacked = 0.0;  // 0 under DoS, mu under deception, else sensed
  bool is_dos = false, is_deception = false;
  bool clean_bit = false, bit = false;
};
BinaryReading read_binary_sensor(double energy, double threshold, double dos, double deception,
                                 const BinarySensorDraws& draws);

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
  BinarySensorDraws draw(std::size_t sensor, std::uint32_t step) const;

  BinaryTargetModel model_;
  BinaryTargetPlantOptions options_;
  RandomStream process_noise_, sensor_noise_, sensor_attack_;
  BinaryTargetModel::State state_;
  PlantStep step_;
};

}  // namespace holdfast
