#include "estimators/attack_assumptions.h"

namespace holdfast {

void AttackAssumptions::Period::read(ConfigurationMap& map, int num_measurements) {
  map.read_or_same("attack_probability", attack_probability, kProbability);
  map.read_or_same("dos_probability", dos_probability, kProbability);
  ConfigurationMap bias_map = map.map("bias");
  bias_map.read_or_same("probability", bias_probability, kProbability);
  bias.read(bias_map, num_measurements);
  ConfigurationMap scale_map = map.map("scale");
  scale_map.read_or_same("probability", scale_probability, kProbability);
  scale_map.read("mean", scale_mean);
  scale_map.read("std", scale_std, kNonNegative);
}

AttackStatistics AttackAssumptions::Period::statistics(int num_measurements) const {
  const Gaussian of_bias = bias.gaussian(num_measurements);
  return {attack_probability, dos_probability,    bias_probability, scale_probability,
          of_bias.mean,       of_bias.covariance, scale_mean,       scale_std};
}

void AttackAssumptions::Period::set(const AttackStatistics& statistics) {
  attack_probability = statistics.attack_probability;
  dos_probability = statistics.dos_probability;
  bias_probability = statistics.bias_probability;
  scale_probability = statistics.scale_probability;
  scale_mean = statistics.scale_mean;
  scale_std = statistics.scale_std;
  bias.mean.assign(statistics.bias_mean.begin(), statistics.bias_mean.end());
  bias.covariance.clear();
  for (const auto& row : statistics.bias_covariance.rowwise()) {
    bias.covariance.emplace_back(row.begin(), row.end());
  }
}

void AttackAssumptions::read(ConfigurationMap map, int num_measurements) {
  periods.resize(1);
  periods.front().first_step = 1;
  periods.front().read(map, num_measurements);
  for (ConfigurationMap& change : map.maps("changes")) {
    Period period = periods.back();
    change.require("first_step");
    change.read("first_step", period.first_step, {2.0, 1e15});
    if (period.first_step <= periods.back().first_step) {
      change.problem("first_step", "must lie above the one before");
    }
    period.read(change, num_measurements);
    periods.push_back(std::move(period));
  }
}

}  // namespace holdfast
