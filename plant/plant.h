#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "common/mode_change.h"

namespace holdfast {

/// What an attack on signals did in one step.
struct AttackSignal {
  std::string name;
  std::vector<double> value;
};

/// One step of a plant: the truth, and what its sensors send.
struct PlantStep {
  std::int64_t step = 0;
  int mode = 0;
  Eigen::VectorXd state;                            // [n]
  std::vector<std::vector<double>> readings;        // readings[source]: values that go on the bus
  std::vector<std::vector<double>> clean_readings;  // the same without any attack at the sensor
  std::vector<AttackSignal> attack_signals;
};

/// A plant: truth and sensors on top of a model. Pure; all randomness comes from named streams.
class Plant {
 public:
  virtual ~Plant() = default;
  /// Moves to the next step, from 1. The reference holds until the next call.
  virtual const PlantStep& advance() = 0;
  /// Takes a command that came on the way back; a plant that has no modes refuses all.
  virtual CommandOutcome obey(const ModeChange&) { return CommandOutcome::kRefused; }
  /// Names of the states with units, e.g. "x_position_m".
  virtual std::vector<std::string> state_names() const = 0;
};

}  // namespace holdfast
