#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "common/configuration.h"
#include "common/models/system_model.h"
#include "estimators/kalman_core.h"
#include "estimators/packet_choice.h"
#include "estimators/sigma_points.h"

namespace holdfast {

/// A Gaussian in a scenario: `mean` and, as `std` or `covariance`, how far to trust it.
struct GaussianOptions {
  std::vector<double> mean;                     // empty: zeros
  std::vector<double> std = {1.0};              // of each component; one number: of all
  std::vector<std::vector<double>> covariance;  // not empty: instead of std

  /// A number for mean or std stands for equal ones.
  void read(ConfigurationMap map, int size);
  /// Throws UsageError when a size is wrong or the covariance is not symmetric and >= 0.
  Gaussian gaussian(int size) const;
};

/// Where fake packets are believed to lie, uniformly.
struct PacketBoxOptions {
  std::vector<double> low, high;  // [l], units of the readings

  void read(ConfigurationMap map, int num_measurements);
};

/// Reads `packet` (first, last, mean, nearest) and `gate_probability`.
struct VectorOptions {
  PacketRule packet = PacketRule::kNearest;
  double gate_probability = 1.0;  // 1: every packet is let in

  void read(ConfigurationMap& map);
};

/// What filters with one Gaussian that take one vector per step have in common.
struct VectorFilterOptions {
  GaussianOptions start;  // x at start_step, before that step's readings
  int start_step = 1;     // 0: x_0, so that the first step is predicted too; key `start.step`
  // Every run begins at a mean of its own, drawn from `start`; key `start.drawn`.
  bool start_is_drawn = false;
  VectorOptions vector;
  Linearisation linearisation = Linearisation::kExtended;

  void read(ConfigurationMap& map, const SystemModel& model);
  /// Where a run begins; estimators of one run that have equal starts begin alike.
  GaussianOptions start_of_run(int num_states, std::uint64_t seed, std::uint32_t run) const;
};

/// Keys of `method: kalman_filter`.
struct KalmanFilterOptions : VectorFilterOptions {
  bool skip_zero = false;  // a vector of exact zeros says nothing: someone forced it

  void read(ConfigurationMap& map, const SystemModel& model);
};

/// Keys of `method: probabilistic_data_association`.
struct ProbabilisticDataAssociationOptions {
  GaussianOptions start;
  double delivery_probability = 0.95;  // pd
  PacketBoxOptions packet_box;

  void read(ConfigurationMap& map, const SystemModel& model);
};

/// Keys of `method: joint_input_state`.
struct JointInputStateOptions {
  GaussianOptions start;
  GaussianOptions attack_prior{{}, {10.0}, {}};  // p(a)
  Feedthrough feedthrough = Feedthrough::kAuto;
  VectorOptions vector;

  void read(ConfigurationMap& map, const SystemModel& model);
};

/// Keys of `method: interacting_multiple_model`.
struct InteractingMultipleModelOptions {
  enum class Packets {
    kChoice,  // one vector, by the rule `packet`
    kAll      // every packet, by probabilistic data association in each mode
  };

  GaussianOptions start;
  GaussianOptions attack_prior{{}, {10.0}, {}};
  Feedthrough feedthrough = Feedthrough::kAuto;
  double start_attack_probability = 0.1;  // at step 1, before Z_1; key `start.attack_probability`
  double birth_probability = 0.05;        // pb
  double survival_probability = 0.95;     // ps
  Packets packets = Packets::kAll;
  VectorOptions vector;
  double delivery_probability = 0.95;
  PacketBoxOptions packet_box;

  void read(ConfigurationMap& map, const SystemModel& model);
};

}  // namespace holdfast
