#include "tests/unit/estimators/baselines/every_baseline.h"

#include <utility>

namespace holdfast::testing {
namespace {

template <class Method, class Options>
Subject subject(const std::string& name, const SystemModel& model, const Options& options,
                const Rows& rows) {
  auto method = std::make_unique<Method>(model, options, rows);
  const Method* const counted = method.get();
  return {name, std::move(method), [counted] { return counted->refused_packets(); }};
}

}  // namespace

std::vector<Subject> every_baseline(const SystemModel& model, const Rows& rows) {
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

Eigen::VectorXd reading(int step) {
  const RandomStream stream(9, 0, "test/reading");
  Eigen::VectorXd y(4);
  for (int i = 0; i < 4; ++i) y[i] = stream.normal(static_cast<std::uint32_t>(step), i);
  return y;
}

}  // namespace holdfast::testing
