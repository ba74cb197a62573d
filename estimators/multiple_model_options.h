#pragma once

#include <vector>

#include "common/configuration.h"
#include "common/models/mode_set.h"
#include "estimators/baseline_options.h"
#include "estimators/mode_bank.h"

namespace holdfast {

/// Reads `likelihood`, `input_std` and `improve_input`.
void read_rule(ConfigurationMap& map, InputStateRule& rule);

/// Reads `packet`, kFirst unless said otherwise. Reports a gate and `packet: nearest`: how near a
/// packet is depends on inputs that are unknown.
void read_unknown_input_vector(ConfigurationMap& map, VectorOptions& vector);

/// Keys of `method: multiple_model`; the modes are read apart (ModeSet).
struct MultipleModelOptions {
  enum class Output {
    kMostProbable,  // the estimate of the most probable mode
    kMixture        // moments of all modes together
  };

  GaussianOptions start;  // x at the first step, after its readings
  ModeBankOptions bank;
  double stay_probability = 1.0;  // of a step; below 1: modes change, to each other one alike
  Output output = Output::kMostProbable;
  VectorOptions vector;

  void read(ConfigurationMap& map, const ModeSet& modes);
};

}  // namespace holdfast
