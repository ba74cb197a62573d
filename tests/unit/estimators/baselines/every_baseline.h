#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "estimators/attack_mixture.h"
#include "estimators/gslr.h"
#include "estimators/interacting_multiple_model.h"
#include "estimators/joint_input_state.h"
#include "estimators/kalman_filter.h"
#include "estimators/probabilistic_data_association.h"
#include "tests/unit/estimators/baselines/baseline_cases.h"

namespace holdfast::testing {

/// A baseline and how many packets it has refused.
struct Subject {
  std::string name;
  std::unique_ptr<Estimator> estimator;
  std::function<std::int64_t()> refused;
};

std::vector<Subject> every_baseline(const SystemModel& model, const Rows& rows);

/// Four standard normal numbers, others at each step.
Eigen::VectorXd reading(int step);

}  // namespace holdfast::testing
