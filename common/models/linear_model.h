#pragma once

#include "common/configuration.h"
#include "common/models/system_model.h"

namespace holdfast {

/// Reads a linear SystemModel's keys over the values that stand: step_s; A, C, G, H, B, D, Q, R as
/// lists of rows; state_names, measurement_names, attack_names, input_names. G and H may be left
/// out together (no attack channel) or one of them (zeros), and so may B and D (no known input);
/// names left out are x_1, y_1, a_1, u_1, ... Reports what SystemModel::problems() says and names
/// that do not fit.
void read_linear_model(ConfigurationMap map, SystemModel& model);

/// Writes A, C, G, H, Q, R, and B and D if there are known inputs, of any model into the resolved
/// document, below the key "matrices", and the names, so that an estimator in any language needs
/// only the log. A document that holds them already must hold the same ones.
void resolve_matrices(ConfigurationMap& map, const SystemModel& model);

}  // namespace holdfast
