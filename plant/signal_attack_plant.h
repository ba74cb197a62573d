#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/models/system_model.h"
#include "common/random_stream.h"
#include "common/step_window.h"
#include "common/waveform.h"
#include "plant/plant.h"

namespace holdfast {

/// One signal that enters the plant through an attack channel.
struct SignalAttack {
  int channel = 0;  // column of G and H
  StepWindow window;
  Waveform waveform;  // begins with the first step of the window
};

/// YAML keys below "plant" have these names.
struct SignalAttackPlantOptions {
  std::vector<double> start_state;  // [n], x at start_step
  int start_step = 1;               // 0: x_0, which moves once before the first reading
  std::vector<double> start_std;    // [n], of a random start around it; zeros: none
  std::vector<SignalAttack> signal_attacks;

  /// Keys start_state, start_step, start_std and signal_attacks: a list of {channel, window,
  /// waveform ...}.
  void read(ConfigurationMap& map, const SystemModel& model, const std::string& folder);
};

/// A plant with vector measurements and attacks on its actuators and sensors (SystemModel).
///
/// Step k has x_k, a_k and y_k = h(x_k, a_k) + v_k; then x_{k+1} = f(x_k, a_k) + w_k. Attack signal
/// "attack" holds a_k, one value per channel, zero outside the windows. Clean readings lack the
/// feedthrough of a_k, not its effect on the state. The mode is 1 while a_k is not zero, else 0.
class SignalAttackPlant : public Plant {
 public:
  /// rows[source]: which rows of y that source sends. Precondition: the model has no problems().
  SignalAttackPlant(SystemModel model, SignalAttackPlantOptions options,
                    std::vector<std::vector<int>> rows, std::uint64_t seed, std::uint32_t run);

  const PlantStep& advance() override;
  std::vector<std::string> state_names() const override { return model_.state_names; }

 private:
  void move(std::uint32_t step);
  void set_attack();
  void measure(std::uint32_t step);

  SystemModel model_;
  SignalAttackPlantOptions options_;
  std::vector<std::vector<int>> rows_;
  RandomStream start_, process_noise_, measurement_noise_;
  Eigen::MatrixXd process_root_, measurement_root_;  // L with L L' = Q, R
  Eigen::VectorXd attack_, no_attack_, next_, normals_, noise_, reading_, clean_;
  PlantStep step_;
};

}  // namespace holdfast
