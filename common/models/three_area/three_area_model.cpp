#include "common/models/three_area/three_area_model.h"

#include <unsupported/Eigen/MatrixFunctions>

#include "common/errors.h"

namespace holdfast {
namespace {

constexpr int kAreas = 3, kOfArea = 3, kStates = 12;

// The area's constants and the ties' stiffness, paper 004, section VI; s and per unit.
constexpr std::array<double, kAreas> kDamping = {3.0, 0.275, 2.0};
constexpr std::array<double, kAreas> kDroop = {0.03, 0.07, 0.04};
constexpr std::array<double, kAreas> kInertia = {4.0, 40.0, 35.0};
constexpr std::array<double, kAreas> kTurbine = {5.0, 10.0, 20.0};
constexpr std::array<double, kAreas> kGovernor = {4.0, 25.0, 15.0};
constexpr std::array<double, kAreas> kStiffness = {2.54, 1.5, 2.5};

constexpr std::array<double, kStates> kProcess = {1.0, 1.6,  2.0, 1.2, 2.5, 1.4,
                                                  0.3, 2.11, 3.0, 0.2, 0.9, 1.8};
constexpr std::array<double, kStates> kMeasurement = {2.1, 0.6, 2.2, 0.2, 1.9, 1.4,
                                                      1.3, 1.1, 2.3, 1.2, 0.3, 1.8};

Eigen::MatrixXd diagonal(const std::vector<double>& given,
                         const std::array<double, kStates>& hundredths, const char* what) {
  Eigen::VectorXd variances(kStates);
  if (!given.empty() && given.size() != kStates) {
    throw UsageError(std::string("three areas: ") + what + " must be 12 numbers");
  }
  for (int i = 0; i < kStates; ++i) {
    const auto index = static_cast<std::size_t>(i);
    variances[i] = given.empty() ? 1e-2 * hundredths[index] : given[index];
  }
  return variances.asDiagonal();
}

Eigen::MatrixXd continuous(const std::array<bool, kAreas>& is_closed) {
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(kStates, kStates);
  for (int area = 0; area < kAreas; ++area) {
    const auto i = static_cast<std::size_t>(area);
    const int w = kOfArea * area, power = w + 1, valve = w + 2;
    A(w, w) = -kDamping[i] / kInertia[i];
    A(w, power) = 1.0 / kInertia[i];
    A(power, power) = -1.0 / kTurbine[i];
    A(power, valve) = 1.0 / kTurbine[i];
    A(valve, valve) = -1.0 / kGovernor[i];
    A(valve, w) = -1.0 / (kDroop[i] * kGovernor[i]);
  }
  for (int tie = 0; tie < kAreas; ++tie) {
    const auto i = static_cast<std::size_t>(tie);
    if (!is_closed[i]) continue;
    const int state = kOfArea * kAreas + tie, next = (tie + 1) % kAreas;
    A(state, kOfArea * tie) = kStiffness[i];
    A(state, kOfArea * next) = -kStiffness[i];
    A(kOfArea * tie, state) = -1.0 / kInertia[i];
    A(kOfArea * next, state) = 1.0 / kInertia[static_cast<std::size_t>(next)];
  }
  return A;
}

}  // namespace

void ThreeAreaOptions::read(ConfigurationMap& map) {
  map.read("step_s", step_s, kPositive);
  map.read_choice("open_tie", open_tie, {{"zero", OpenTie::kZero}, {"frozen", OpenTie::kFrozen}});
  const std::vector<std::string> before = ties;
  map.read("ties", ties);
  if (ties.empty()) {
    map.problem("ties", "must name at least one topology");
    ties = before;
  }
  const auto read_variances = [&map](const char* key, std::vector<double>& values,
                                     const std::array<double, kStates>& hundredths,
                                     Interval allowed) {
    if (values.empty()) {
      for (const double value : hundredths) values.push_back(1e-2 * value);
    }
    map.read_shared(key, values, kStates, allowed);
  };
  read_variances("process_variance", process_variance, kProcess, kNonNegative);
  read_variances("measurement_variance", measurement_variance, kMeasurement, kPositive);
}

SystemModel make_three_area_model(const ThreeAreaOptions& options, const std::string& ties) {
  if (ties.size() != kAreas || ties.find_first_not_of("01") != std::string::npos) {
    throw UsageError("three areas: ties must be three of 0 and 1, as \"110\", not '" + ties + "'");
  }
  if (!(options.step_s > 0.0)) throw UsageError("three areas: step_s must be positive");
  const std::array<bool, kAreas> is_closed = {ties[0] == '1', ties[1] == '1', ties[2] == '1'};
  SystemModel model;
  model.step_s = options.step_s;
  model.A = (options.step_s * continuous(is_closed)).exp();
  for (int tie = 0; tie < kAreas; ++tie) {
    const int state = kOfArea * kAreas + tie;
    if (!is_closed[static_cast<std::size_t>(tie)] &&
        options.open_tie == ThreeAreaOptions::OpenTie::kZero) {
      model.A.row(state).setZero();
    }
  }
  model.C = Eigen::MatrixXd::Identity(kStates, kStates);
  model.Q = diagonal(options.process_variance, kProcess, "process_variance");
  model.R = diagonal(options.measurement_variance, kMeasurement, "measurement_variance");
  model.G = Eigen::MatrixXd::Zero(kStates, kAreas);
  model.H = Eigen::MatrixXd::Zero(kStates, kAreas);
  for (int area = 0; area < kAreas; ++area) {
    const std::string number = std::to_string(area + 1);
    model.H(kOfArea * area, area) = 1.0;
    model.attack_names.push_back("w_" + number);
    for (const char* name : {"omega_", "mechanical_power_", "valve_"}) {
      model.state_names.push_back(name + number);
    }
  }
  for (const char* tie : {"tie_power_12", "tie_power_23", "tie_power_31"}) {
    model.state_names.emplace_back(tie);
  }
  model.measurement_names = model.state_names;
  return model;
}

}  // namespace holdfast
