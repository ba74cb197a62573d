#include "plant/signal_attack_plant.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

namespace holdfast {
namespace {

// Q may be singular, so no Cholesky factor: V sqrt(D) serves any covariance.
Eigen::MatrixXd root_of(const Eigen::MatrixXd& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

void draw_normals(const RandomStream& stream, std::uint32_t step, Eigen::VectorXd& normals) {
  for (Eigen::Index i = 0; i < normals.size(); ++i) {
    normals[i] = stream.normal(step, static_cast<std::uint64_t>(i));
  }
}

}  // namespace

void SignalAttackPlantOptions::read(ConfigurationMap& map, const SystemModel& model,
                                    const std::string& folder) {
  const auto n = static_cast<std::size_t>(model.num_states());
  start_state.resize(n, 0.0);
  start_std.resize(n, 0.0);
  map.read("start_state", start_state, n);
  map.read("start_step", start_step, {0.0, 1.0});
  map.read_shared("start_std", start_std, n, kNonNegative);
  for (ConfigurationMap& entry : map.maps("signal_attacks")) {
    SignalAttack attack;
    std::string channel;
    entry.require("channel");
    entry.read("channel", channel);
    const auto found = std::find(model.attack_names.begin(), model.attack_names.end(), channel);
    attack.channel = static_cast<int>(found - model.attack_names.begin());
    if (entry.has("channel") && found == model.attack_names.end()) {
      std::string names;
      for (const std::string& name : model.attack_names)
        names += (names.empty() ? "" : ", ") + name;
      entry.problem("channel", "'" + channel + "' is none of the plant's attack channels: " +
                                   (names.empty() ? "it has none" : names));
    }
    attack.window.read(entry.map("window"));
    attack.waveform.read(entry, folder);
    signal_attacks.push_back(std::move(attack));
  }
}

SignalAttackPlant::SignalAttackPlant(SystemModel model, SignalAttackPlantOptions options,
                                     std::vector<std::vector<int>> rows, std::uint64_t seed,
                                     std::uint32_t run)
    : model_(std::move(model)),
      options_(std::move(options)),
      rows_(std::move(rows)),
      start_(seed, run, "plant/start"),
      process_noise_(seed, run, "plant/process_noise"),
      measurement_noise_(seed, run, "plant/measurement_noise"),
      process_root_(root_of(model_.Q)),
      measurement_root_(root_of(model_.R)),
      attack_(Eigen::VectorXd::Zero(model_.num_attack_channels())),
      no_attack_(attack_),
      next_(model_.num_states()),
      reading_(model_.num_measurements()),
      clean_(model_.num_measurements()) {
  step_.state = Eigen::Map<const Eigen::VectorXd>(options_.start_state.data(), next_.size());
  normals_.resize(next_.size());
  draw_normals(start_, 0, normals_);
  for (Eigen::Index i = 0; i < next_.size(); ++i) {
    step_.state[i] += options_.start_std[static_cast<std::size_t>(i)] * normals_[i];
  }
  for (const std::vector<int>& source : rows_) {
    step_.readings.emplace_back(source.size(), 0.0);
  }
  step_.clean_readings = step_.readings;
  if (attack_.size() > 0) {
    step_.attack_signals.push_back(
        {"attack", std::vector<double>(static_cast<std::size_t>(attack_.size()), 0.0)});
  }
}

void SignalAttackPlant::move(std::uint32_t step) {
  model_.move(step_.state, attack_, next_);
  normals_.resize(next_.size());
  draw_normals(process_noise_, step, normals_);
  step_.state = next_;
  step_.state.noalias() += process_root_ * normals_;
}

void SignalAttackPlant::set_attack() {
  attack_.setZero();
  for (const SignalAttack& attack : options_.signal_attacks) {
    if (!attack.window.contains(step_.step, model_.step_s)) continue;
    const double from_time = std::ceil(attack.window.from_s / model_.step_s - 1e-6);
    const std::int64_t first =
        std::max(attack.window.first_step, static_cast<std::int64_t>(from_time));
    attack_[attack.channel] += attack.waveform.value(step_.step - first, model_.step_s);
  }
  step_.mode = attack_.isZero(0.0) ? 0 : 1;
  if (attack_.size() > 0) {
    std::copy(attack_.begin(), attack_.end(), step_.attack_signals.front().value.begin());
  }
}

void SignalAttackPlant::measure(std::uint32_t step) {
  normals_.resize(reading_.size());
  draw_normals(measurement_noise_, step, normals_);
  noise_.noalias() = measurement_root_ * normals_;
  model_.measure(step_.state, attack_, reading_);
  model_.measure(step_.state, no_attack_, clean_);
  reading_ += noise_;
  clean_ += noise_;
  for (std::size_t source = 0; source < rows_.size(); ++source) {
    for (std::size_t i = 0; i < rows_[source].size(); ++i) {
      step_.readings[source][i] = reading_[rows_[source][i]];
      step_.clean_readings[source][i] = clean_[rows_[source][i]];
    }
  }
}

const PlantStep& SignalAttackPlant::advance() {
  const auto step = static_cast<std::uint32_t>(++step_.step);
  if (step > 1 || options_.start_step == 0) move(step - 1);
  set_attack();
  measure(step);
  return step_;
}

}  // namespace holdfast
