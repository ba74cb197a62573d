#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/channel_signal.h"
#include "common/mode_change.h"
#include "common/models/mode_set.h"
#include "common/random_stream.h"
#include "plant/plant.h"

namespace holdfast {

/// YAML keys below "plant" have these names.
struct SignalAttackPlantOptions {
  std::vector<double> start_state;            // [n], x at start_step
  int start_step = 1;                         // 0: x_0, which moves once before the first reading
  std::vector<double> start_std;              // [n], of a random start around it; zeros: none
  std::vector<ChannelSignal> signal_attacks;  // channel: column of G and H
  double attack_gain = 1.0;                   // multiplies all of them
  std::vector<ModeChange> mode_changes;       // steps ascend; mode 0 before the first
  std::vector<ChannelSignal> inputs;          // u, known to everyone

  /// Keys start_state, start_step, start_std, signal_attacks, a list of {channel, window, waveform
  /// ...}, attack_gain, mode_changes, a list of {mode, from_step}, and inputs, as signal_attacks.
  void read(ConfigurationMap& map, const ModeSet& modes, const std::string& folder);
  /// a of a step, as if every mode listed all channels, and random walks stood at their start.
  Eigen::VectorXd attack(std::int64_t step, const SystemModel& model) const;
  /// u of a step.
  Eigen::VectorXd input(std::int64_t step, const SystemModel& model) const;
};

/// A plant with vector measurements and attacks on its actuators and sensors (SystemModel).
///
/// Step k has x_k, u_k, a_k and y_k = h(x_k, a_k) + D u_k + v_k; then x_{k+1} = f(x_k, a_k) + B u_k
/// + w_k, f and h of the mode of step k. Attack signal "attack" holds a_k, one value per channel,
/// zero outside the windows and in channels that the mode does not list. Clean readings lack the
/// feedthrough of a_k, not its effect on the state. With one mode only, the step's mode is 1 while
/// a_k is not zero, else 0; else the mode's index.
class SignalAttackPlant : public Plant {
 public:
  /// rows[source]: which rows of y that source sends. Precondition: no topology has problems(), and
  /// there is a mode.
  SignalAttackPlant(ModeSet modes, SignalAttackPlantOptions options,
                    std::vector<std::vector<int>> rows, std::uint64_t seed, std::uint32_t run);

  const PlantStep& advance() override;
  /// The newest command for a step counts, before what the options say for it. Refused: a mode that
  /// the plant has not, and a command beyond the first kCommandsMax that wait for their steps.
  CommandOutcome obey(const ModeChange& command) override;
  static constexpr std::size_t kCommandsMax = 4096;

  std::vector<std::string> state_names() const override {
    return modes_.topologies.front().state_names;
  }

 private:
  void move(std::uint32_t step);
  void set_mode();
  void set_attack();
  void advance_walks();
  void measure(std::uint32_t step);
  const SystemModel& model() const { return modes_.topologies[topology_]; }

  ModeSet modes_;
  SignalAttackPlantOptions options_;
  std::vector<std::vector<int>> rows_;
  RandomStream start_, process_noise_, measurement_noise_, attack_walk_;
  std::vector<Eigen::MatrixXd> process_roots_, measurement_roots_;  // L with L L' = Q, R
  std::vector<ModeChange> changes_;  // those that are to come, by step
  std::vector<double> walks_;        // of signal attacks that are random walks
  std::size_t mode_ = 0, topology_ = 0;
  Eigen::VectorXd attack_, no_attack_, input_, next_, normals_, noise_, reading_, clean_;
  PlantStep step_;
};

}  // namespace holdfast
