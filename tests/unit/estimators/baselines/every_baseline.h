#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
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

template <class Method, class Options>
inline Subject subject(const std::string& name, const SystemModel& model, const Options& options,
                       const Rows& rows) {
  auto method = std::make_unique<Method>(model, options, rows);
  const Method* const counted = method.get();
  return {name, std::move(method), [counted] { return counted->refused_packets(); }};
}

inline std::vector<Subject> every_baseline(const SystemModel& model, const Rows& rows) {
  std::vector<Subject> all;
  for (const PacketRule rule :
       {PacketRule::kFirst, PacketRule::kLast, PacketRule::kMean, PacketRule::kNearest}) {
    KalmanFilterOptions kalman;
    kalman.vector = {rule, 0.9999};
    all.push_back(subject<KalmanFilter>("kalman_filter", model, kalman, rows));
    GslrOptions gslr;
    gslr.vector = {rule, 0.9999};
    all.push_back(subject<Gslr>("gslr", model, gslr, rows));
    AttackMixtureOptions mixture;
    mixture.vector = {rule, 0.9999};
    all.push_back(subject<AttackMixture>("attack_mixture", model, mixture, rows));
    JointInputStateOptions joint;
    joint.vector = {rule, 1.0};
    all.push_back(subject<JointInputState>("joint_input_state", model, joint, rows));
  }
  ProbabilisticDataAssociationOptions association;
  association.packet_box = {std::vector<double>(4, -5.0), std::vector<double>(4, 5.0)};
  all.push_back(subject<ProbabilisticDataAssociation>("probabilistic_data_association", model,
                                                      association, rows));
  InteractingMultipleModelOptions modes;
  modes.packet_box = association.packet_box;
  all.push_back(
      subject<InteractingMultipleModel>("interacting_multiple_model", model, modes, rows));
  modes.packets = InteractingMultipleModelOptions::Packets::kChoice;
  all.push_back(
      subject<InteractingMultipleModel>("interacting_multiple_model", model, modes, rows));
  return all;
}

inline Eigen::VectorXd reading(int k) {
  const RandomStream stream(9, 0, "test/reading");
  Eigen::VectorXd y(4);
  for (int i = 0; i < 4; ++i) y[i] = stream.normal(static_cast<std::uint32_t>(k), i);
  return y;
}

}  // namespace holdfast::testing
