#include "plant/signal_attack_plant.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "common/name_list.h"

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

void read_mode_changes(ConfigurationMap& map, const ModeSet& modes,
                       std::vector<ModeChange>& changes) {
  for (ConfigurationMap& entry : map.maps("mode_changes")) {
    ModeChange change;
    change.mode = read_name(entry, "mode", "the plant's modes", modes.names());
    entry.require("from_step");
    entry.read("from_step", change.from_step, {1.0, 1e9});
    if (!changes.empty() && change.from_step <= changes.back().from_step) {
      entry.problem("from_step", "must lie after that of the change before");
    }
    changes.push_back(change);
  }
}

}  // namespace

void SignalAttackPlantOptions::read(ConfigurationMap& map, const ModeSet& modes,
                                    const std::string& folder) {
  const SystemModel& model = modes.topologies.front();
  const auto n = static_cast<std::size_t>(model.num_states());
  start_state.resize(n, 0.0);
  start_std.resize(n, 0.0);
  map.read("start_state", start_state, n);
  map.read("start_step", start_step, {0.0, 1.0});
  map.read_shared("start_std", start_std, n, kNonNegative);
  signal_attacks = read_channel_signals(map, "signal_attacks", "the plant's attack channels",
                                        model.attack_names, folder, true);
  inputs =
      read_channel_signals(map, "inputs", "the plant's known inputs", model.input_names, folder);
  map.read("attack_gain", attack_gain);
  read_mode_changes(map, modes, mode_changes);
}

Eigen::VectorXd SignalAttackPlantOptions::attack(std::int64_t step,
                                                 const SystemModel& model) const {
  Eigen::VectorXd a = Eigen::VectorXd::Zero(model.num_attack_channels());
  add_signals(signal_attacks, step, model.step_s, a);
  return attack_gain * a;
}

Eigen::VectorXd SignalAttackPlantOptions::input(std::int64_t step, const SystemModel& model) const {
  Eigen::VectorXd u = Eigen::VectorXd::Zero(model.num_inputs());
  add_signals(inputs, step, model.step_s, u);
  return u;
}

SignalAttackPlant::SignalAttackPlant(ModeSet modes, SignalAttackPlantOptions options,
                                     std::vector<std::vector<int>> rows, std::uint64_t seed,
                                     std::uint32_t run)
    : modes_(std::move(modes)),
      options_(std::move(options)),
      rows_(std::move(rows)),
      start_(seed, run, "plant/start"),
      process_noise_(seed, run, "plant/process_noise"),
      measurement_noise_(seed, run, "plant/measurement_noise"),
      attack_walk_(seed, run, "plant/attack_walk"),
      changes_(options_.mode_changes),
      walks_(options_.signal_attacks.size(), 0.0),
      attack_(Eigen::VectorXd::Zero(model().num_attack_channels())),
      no_attack_(attack_),
      input_(Eigen::VectorXd::Zero(model().num_inputs())),
      next_(model().num_states()),
      reading_(model().num_measurements()),
      clean_(model().num_measurements()) {
  for (const SystemModel& topology : modes_.topologies) {
    process_roots_.push_back(root_of(topology.Q));
    measurement_roots_.push_back(root_of(topology.R));
  }
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
  model().move(step_.state, attack_, next_);
  if (input_.size() > 0) next_.noalias() += model().B * input_;
  normals_.resize(next_.size());
  draw_normals(process_noise_, step, normals_);
  step_.state = next_;
  step_.state.noalias() += process_roots_[topology_] * normals_;
}

CommandOutcome SignalAttackPlant::obey(const ModeChange& command) {
  if (command.mode < 0 || command.mode >= static_cast<int>(modes_.modes.size()))
    return CommandOutcome::kRefused;
  const bool is_late = command.from_step <= step_.step;
  const ModeChange change{is_late ? step_.step + 1 : command.from_step, command.mode};
  auto place = std::find_if(changes_.begin(), changes_.end(), [&change](const ModeChange& it) {
    return it.from_step >= change.from_step;
  });
  if (place != changes_.end() && place->from_step == change.from_step) {
    place->mode = change.mode;
  } else {
    if (changes_.size() >= options_.mode_changes.size() + kCommandsMax)
      return CommandOutcome::kRefused;
    changes_.insert(place, change);
  }
  return is_late ? CommandOutcome::kLate : CommandOutcome::kObeyed;
}

void SignalAttackPlant::set_mode() {
  const auto is_due = [this](const ModeChange& change) { return change.from_step <= step_.step; };
  const auto first_to_come = std::find_if_not(changes_.begin(), changes_.end(), is_due);
  if (first_to_come != changes_.begin()) {
    mode_ = static_cast<std::size_t>(std::prev(first_to_come)->mode);
    changes_.erase(changes_.begin(), first_to_come);
  }
  topology_ = static_cast<std::size_t>(modes_.modes[mode_].topology);
}

void SignalAttackPlant::advance_walks() {
  for (std::size_t i = 0; i < walks_.size(); ++i) {
    const ChannelSignal& signal = options_.signal_attacks[i];
    if (signal.waveform.kind != Waveform::Kind::kRandomWalk ||
        step_.step <= signal.window.first(model().step_s)) {
      continue;
    }
    walks_[i] += attack_walk_.normal(static_cast<std::uint32_t>(step_.step), i);
  }
}

void SignalAttackPlant::set_attack() {
  advance_walks();
  attack_.setZero();
  add_signals(options_.signal_attacks, step_.step, model().step_s, attack_, walks_);
  attack_ *= options_.attack_gain;
  const std::vector<int>& channels = modes_.modes[mode_].channels;
  for (int channel = 0; channel < static_cast<int>(attack_.size()); ++channel) {
    if (!std::binary_search(channels.begin(), channels.end(), channel)) attack_[channel] = 0.0;
  }
  const bool has_modes = modes_.modes.size() > 1;
  step_.mode = has_modes ? static_cast<int>(mode_) : attack_.isZero(0.0) ? 0 : 1;
  if (attack_.size() > 0) {
    std::copy(attack_.begin(), attack_.end(), step_.attack_signals.front().value.begin());
  }
}

void SignalAttackPlant::measure(std::uint32_t step) {
  normals_.resize(reading_.size());
  draw_normals(measurement_noise_, step, normals_);
  noise_.noalias() = measurement_roots_[topology_] * normals_;
  model().measure(step_.state, attack_, reading_);
  model().measure(step_.state, no_attack_, clean_);
  if (input_.size() > 0) noise_.noalias() += model().D * input_;
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
  set_mode();
  set_attack();
  if (input_.size() > 0) {
    input_.setZero();
    add_signals(options_.inputs, step_.step, model().step_s, input_);
  }
  measure(step);
  return step_;
}

}  // namespace holdfast
