#include "common/models/ieee14/ieee14_model.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string>

#include "common/errors.h"
#include "common/models/ieee14/swing_equation.h"

namespace holdfast {
namespace {

constexpr int kBuses = 14, kGenerators = SwingEquation::kGenerators;
constexpr std::array<int, kGenerators> kGeneratorBuses = {1, 2, 3, 6, 8};
constexpr std::array<std::array<int, 2>, 20> kBranches = {
    {{1, 2},  {1, 5},  {2, 3},  {2, 4}, {2, 5}, {3, 4},  {4, 5},  {4, 7},   {4, 9},   {5, 6},
     {6, 11}, {6, 12}, {6, 13}, {7, 8}, {7, 9}, {9, 10}, {9, 14}, {10, 11}, {12, 13}, {13, 14}}};

std::vector<double> inertia_of(const Ieee14Options& options) {
  if (!options.inertia_pu_s2.empty()) return options.inertia_pu_s2;
  if (options.preset == Ieee14Options::Preset::kRealistic) {
    return std::vector<double>(kGenerators, 0.0265);
  }
  return {0.003, 0.007, 0.003, 0.004, 0.006};
}

std::vector<double> damping_of(const Ieee14Options& options) {
  if (!options.damping_pu_s.empty()) return options.damping_pu_s;
  const bool is_realistic = options.preset == Ieee14Options::Preset::kRealistic;
  return std::vector<double>(kGenerators, is_realistic ? 0.05 : 0.002);
}

bool is_bus(double number) {
  return number >= 1.0 && number <= kBuses && number == std::floor(number);
}

void check(const Ieee14Options& options) {
  const auto need = [](bool holds, const char* what) {
    if (!holds) throw UsageError(std::string("ieee14 model: ") + what);
  };
  for (const int bus : options.victims) need(is_bus(bus), "a victim is a bus from 1 to 14");
  need(options.victims.size() <= SwingEquation::kInputsMax, "at most 14 victims");
  const std::vector<double> inertia = inertia_of(options), damping = damping_of(options);
  need(inertia.size() == kGenerators && damping.size() == kGenerators,
       "inertia and damping have one number per generator");
  for (const double value : inertia) need(value > 0.0, "inertia must be positive");
  for (const double value : damping) need(value >= 0.0, "damping must not be negative");
  need(options.step_s > 0.0, "step_s must be positive");
  need(options.process_noise_intensity >= 0.0, "process_noise_intensity must not be negative");
  need(options.measurement_noise_std > 0.0, "measurement_noise_std must be positive");
  need(options.substeps >= 1, "substeps must be at least 1");
}

SwingEquation::Parameters parameters_of(const Ieee14Options& options) {
  const Ieee14Network network = ieee14_network();
  SwingEquation::Parameters parameters;
  parameters.laplacian = network.laplacian;
  parameters.inertia = SwingEquation::Generators(inertia_of(options).data());
  parameters.damping = SwingEquation::Generators(damping_of(options).data());
  parameters.input.resize(kGenerators, static_cast<Eigen::Index>(options.victims.size()));
  for (Eigen::Index i = 0; i < parameters.input.cols(); ++i) {
    const int bus = options.victims[static_cast<std::size_t>(i)];
    parameters.input.col(i) = -network.participation.col(bus - 1);
  }
  return parameters;
}

void name_signals(const Ieee14Options& options, SystemModel& model) {
  for (int j = 1; j <= kGenerators; ++j) {
    model.state_names.push_back("delta_" + std::to_string(j) + "_rad");
  }
  for (int j = 1; j <= kGenerators; ++j) {
    model.state_names.push_back("omega_" + std::to_string(j) + "_radps");
  }
  model.measurement_names = model.state_names;
  for (const int bus : options.victims) {
    model.attack_names.push_back("load_bus_" + std::to_string(bus) + "_pu");
  }
}

}  // namespace

void Ieee14Options::read(ConfigurationMap& map) {
  if (map.has("preset")) {
    inertia_pu_s2.clear();
    damping_pu_s.clear();
  }
  map.read_choice("preset", preset, {{"drift", Preset::kDrift}, {"realistic", Preset::kRealistic}});
  map.read("nonlinear", nonlinear);
  std::vector<double> buses(victims.begin(), victims.end());
  map.read("victims", buses, 0, {1.0, kBuses});
  if (!std::ranges::all_of(buses, is_bus)) {
    map.problem("victims", "each must be the number of a bus, 1 to 14");
  } else if (buses.size() > SwingEquation::kInputsMax) {
    map.problem("victims", "must be at most 14");
  } else {
    victims.assign(buses.begin(), buses.end());
  }
  map.read("feedthrough_gain", feedthrough_gain);
  map.read("step_s", step_s, kPositive);
  map.read("process_noise_intensity", process_noise_intensity, kNonNegative);
  map.read("measurement_noise_std", measurement_noise_std, kPositive);
  inertia_pu_s2 = inertia_of(*this);
  map.read("inertia_pu_s2", inertia_pu_s2, kGenerators, kPositive);
  damping_pu_s = damping_of(*this);
  map.read("damping_pu_s", damping_pu_s, kGenerators, kNonNegative);
  map.read("substeps", substeps, {1.0, 1000.0});
}

Ieee14Network ieee14_network() {
  Eigen::MatrixXd laplacian = Eigen::MatrixXd::Zero(kBuses, kBuses);
  for (const auto& [from, to] : kBranches) {
    laplacian(from - 1, from - 1) += 1.0;
    laplacian(to - 1, to - 1) += 1.0;
    laplacian(from - 1, to - 1) -= 1.0;
    laplacian(to - 1, from - 1) -= 1.0;
  }
  std::array<bool, kBuses> has_generator{};
  for (const int bus : kGeneratorBuses) has_generator[static_cast<std::size_t>(bus - 1)] = true;
  std::vector<int> passive;
  for (int bus = 1; bus <= kBuses; ++bus) {
    if (!has_generator[static_cast<std::size_t>(bus - 1)]) passive.push_back(bus);
  }
  const auto part = [&laplacian](const auto& rows, const auto& columns) {
    Eigen::MatrixXd result(rows.size(), columns.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
      for (std::size_t j = 0; j < columns.size(); ++j) {
        result(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
            laplacian(rows[i] - 1, columns[j] - 1);
      }
    }
    return result;
  };
  const Eigen::MatrixXd coupling = part(passive, kGeneratorBuses);  // L_eg
  const Eigen::MatrixXd passive_share = -part(passive, passive).llt().solve(coupling);

  Ieee14Network network;
  network.laplacian = part(kGeneratorBuses, kGeneratorBuses) + coupling.transpose() * passive_share;
  network.laplacian = 0.5 * (network.laplacian + network.laplacian.transpose()).eval();
  network.participation = Eigen::MatrixXd::Zero(kGenerators, kBuses);
  for (int j = 0; j < kGenerators; ++j) {
    network.participation(j, kGeneratorBuses[static_cast<std::size_t>(j)] - 1) = 1.0;
  }
  for (std::size_t i = 0; i < passive.size(); ++i) {
    network.participation.col(passive[i] - 1) =
        passive_share.row(static_cast<Eigen::Index>(i)).transpose();
  }
  return network;
}

SystemModel make_ieee14_model(const Ieee14Options& options) {
  check(options);
  const SwingEquation::Parameters parameters = parameters_of(options);
  const SwingEquation::Linear linear = SwingEquation::linearised(parameters, options.step_s);

  SystemModel model;
  const Eigen::Index n = SwingEquation::kStates;
  model.A = linear.A;
  model.G = linear.G;
  model.C = Eigen::MatrixXd::Identity(n, n);
  model.H = options.feedthrough_gain * parameters.input.replicate(2, 1);
  model.Q = options.process_noise_intensity * options.step_s * Eigen::MatrixXd::Identity(n, n);
  model.R = options.measurement_noise_std * options.measurement_noise_std *
            Eigen::MatrixXd::Identity(n, n);
  model.step_s = options.step_s;
  name_signals(options, model);
  if (!options.nonlinear) return model;

  const auto swing =
      std::make_shared<const SwingEquation>(parameters, options.step_s, options.substeps);
  model.transition = [swing](const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                             Eigen::VectorXd& next) { swing->move(x, a, next); };
  model.transition_jacobian = [swing](const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                                      Eigen::MatrixXd& F) { swing->jacobian(x, a, F); };
  return model;
}

}  // namespace holdfast
