#include "tools/bounds/mode_oracle.h"

#include <algorithm>
#include <utility>

namespace holdfast {

void ModeOracleOptions::read(ConfigurationMap& map, const ModeSet& modes) {
  start.read(map.map("start"), modes.topologies.front().num_states());
  read_rule(map, filter);
  read_unknown_input_vector(map, vector);
}

ModeOracle::ModeOracle(const ModeSet& modes, const ModeOracleOptions& options,
                       std::vector<std::vector<int>> rows)
    : vector_(options.vector, std::move(rows), modes.topologies.front().num_measurements()),
      filter_(modes.models(), options.filter, modes.names()),
      publisher_(modes, options.filter) {
  filter_.start(options.start.gaussian(modes.topologies.front().num_states()));
  estimate_.mode_probability.assign(modes.modes.size(), 0.0);
}

// A plant with one mode says with its number whether it is attacked, not which mode it is in.
void ModeOracle::tell(const ToldTruth& truth) {
  const auto num_modes = static_cast<int>(estimate_.mode_probability.size());
  mode_ = truth.mode >= 0 && truth.mode < num_modes ? truth.mode : 0;
}

const Estimate& ModeOracle::step(std::int64_t step, const MeasurementSet& measurements,
                                 const Eigen::VectorXd& known_input) {
  vector_.take(step, measurements, estimate_);
  const InputStateResult result =
      filter_.step(mode_, vector_.rows(), vector_.values(), known_input);
  if (result.kind == InputStateResult::Kind::kFailed) {
    estimate_.outcome = StepOutcome::kFactorisationFailed;
  }
  // An input of the step before belongs to the channels of that step's mode.
  publisher_.publish(filter_, publisher_.is_direct() ? mode_ : previous_mode_, step, estimate_);
  std::fill(estimate_.mode_probability.begin(), estimate_.mode_probability.end(), 0.0);
  estimate_.mode_probability[static_cast<std::size_t>(mode_)] = 1.0;
  previous_mode_ = mode_;
  return estimate_;
}

}  // namespace holdfast
