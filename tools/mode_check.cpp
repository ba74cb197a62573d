#include "tools/mode_check.h"

#include <algorithm>
#include <numeric>

#include "common/subsets.h"
#include "estimators/mode_pair_theory.h"

namespace holdfast {
namespace {

double num_sets(int count, int most) {
  double sum = 0.0;
  for (int size = 0; size <= most; ++size) {
    sum += binomial(count, size);
  }
  return sum;
}

bool contains(const std::vector<int>& set, const std::vector<int>& part) {
  return std::includes(set.begin(), set.end(), part.begin(), part.end());
}

// Sets that cannot be corrected, the smallest first; sets that contain one are left out, since they
// cannot either. correctable_most is the size up to which there is none.
void find_bad_sets(ModeCheck& check) {
  const int largest = std::min(check.num_channels, check.num_sensors);
  check.correctable_most = -1;
  const auto num_topologies = static_cast<double>(check.modes.topologies.size());
  int searched = largest;
  check.is_cut = false;
  while (searched > check.attacked_most &&
         num_topologies * num_sets(check.num_channels, searched) > ModeCheck::kSetsMax) {
    --searched;
  }
  check.is_cut = searched < largest;
  if (num_topologies * num_sets(check.num_channels, searched) > ModeCheck::kSetsMax) return;
  std::vector<int> channels(static_cast<std::size_t>(check.num_channels));
  std::iota(channels.begin(), channels.end(), 0);
  int smallest_bad = std::min(check.num_channels, check.num_sensors) + 1;
  for (int size = 0; size <= std::max(searched, check.attacked_most); ++size) {
    for (std::size_t t = 0; t < check.modes.topologies.size(); ++t) {
      for_each_subset(channels, static_cast<std::size_t>(size), [&](const std::vector<int>& set) {
        const std::string& topology = check.modes.topology_names[t];
        const bool is_known = std::ranges::any_of(check.bad_sets, [&](const BadSet& bad) {
          return bad.topology == topology && contains(set, bad.channels);
        });
        if (is_known) return;
        ModeTheory theory = analyse_mode(check.modes.topologies[t].with_attack_channels(set));
        if (size == 0 ? theory.is_strongly_detectable() : theory.is_correctable()) return;
        smallest_bad = std::min(smallest_bad, size);
        if (size <= check.attacked_most) check.bad_sets.push_back({topology, set, theory});
      });
    }
  }
  check.correctable_most = std::max(0, std::min(smallest_bad - 1, searched));
  check.is_cut = check.is_cut && smallest_bad > searched;
}

void find_protecting(ModeCheck& check) {
  if (check.bad_sets.empty()) return;
  for (int channel = 0; channel < check.num_channels; ++channel) {
    const bool is_in_all = std::ranges::all_of(check.bad_sets, [channel](const BadSet& bad) {
      return std::ranges::find(bad.channels, channel) != bad.channels.end();
    });
    if (is_in_all) check.protecting.push_back(channel);
  }
}

void count_models(ModeCheck& check) {
  int actuators = 0, sensors = 0;
  const SystemModel& model = check.modes.topologies.front();
  for (int i = 0; i < check.num_channels; ++i) {
    ++(model.G.col(i).isZero(0.0) ? sensors : actuators);
  }
  check.models_needed =
      num_models_needed(static_cast<int>(check.modes.topologies.size()), actuators, sensors,
                        check.attacked_most, actuators, sensors);
}

void compare_pairs(const SystemSetup& system, const ModeCheckOptions& options, ModeCheck& check) {
  const auto num_modes = static_cast<int>(check.modes.modes.size());
  if (check.modes.modes.size() > ModeCheck::kComparedMax) return;
  const std::vector<SystemModel> models = check.modes.models();
  const auto n = static_cast<Eigen::Index>(system.model().num_states());
  Gaussian start{Eigen::Map<const Eigen::VectorXd>(system.options.start_state.data(), n),
                 Eigen::MatrixXd::Zero(n, n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    // A start that is known exactly would leave a covariance that no factor has.
    const double std = std::max(1e-6, system.options.start_std[static_cast<std::size_t>(i)]);
    start.covariance(i, i) = std * std;
  }
  const auto input = [&system](std::int64_t step) {
    return system.options.input(step, system.model());
  };
  InputStateRule rule;
  rule.likelihood = options.likelihood;
  rule.input_std = options.input_std;
  for (int i = 0; i < num_modes; ++i) {
    const std::vector<int>& channels = check.modes.modes[static_cast<std::size_t>(i)].channels;
    const auto attack = [&](std::int64_t step) {
      const Eigen::VectorXd all = system.options.attack(step, system.model());
      Eigen::VectorXd values(static_cast<Eigen::Index>(channels.size()));
      for (std::size_t c = 0; c < channels.size(); ++c) {
        values[static_cast<Eigen::Index>(c)] = all[channels[c]];
      }
      return values;
    };
    const auto none = [&](std::int64_t) {
      return Eigen::VectorXd::Zero(static_cast<Eigen::Index>(channels.size())).eval();
    };
    for (int j = 0; j < num_modes; ++j) {
      if (j == i) continue;
      ModeCheck::Pair pair;
      pair.truth = i;
      pair.rival = j;
      pair.is_distinguishable =
          is_state_common(models[static_cast<std::size_t>(i)], models[static_cast<std::size_t>(j)]);
      const auto compare = [&](const auto& signals) {
        return find_divergence(models[static_cast<std::size_t>(i)],
                               models[static_cast<std::size_t>(j)], rule, start, {signals, input},
                               options.num_steps);
      };
      pair.attacked = compare(attack);
      pair.quiet = compare(none);
      check.pairs.push_back(std::move(pair));
    }
  }
}

// What "the scenario's attacks" are not: only signals that the plant applies in the steps that are
// looked at, a walk at its start.
void note_what_is_left_out(const Experiment& experiment, const SystemSetup& system,
                           const ModeCheckOptions& options, ModeCheck& check) {
  if (check.pairs.empty()) return;
  const double step_s = system.model().step_s;
  bool begins_later = false, walks = false;
  for (const ChannelSignal& signal : system.options.signal_attacks) {
    begins_later = begins_later || signal.window.first(step_s) > options.num_steps;
    walks = walks || signal.waveform.kind == Waveform::Kind::kRandomWalk;
  }
  if (begins_later) {
    check.notes.push_back("attacks that begin after step " + std::to_string(options.num_steps) +
                          " are not in the comparison: use a larger --steps");
  }
  if (walks) check.notes.push_back("random walks stand at their start in the comparison");
  if (experiment.has_bus() && !experiment.rules.empty())
    check.notes.push_back("what rules do to frames on the bus is not in the comparison");
}

}  // namespace

ModeCheck check_modes(const Experiment& experiment, const ModeCheckOptions& options) {
  const SystemSetup* system = experiment.plant.system();
  if (system == nullptr || !experiment.plant.command.empty()) {
    throw UsageError("scenario " + experiment.name +
                     ": holdfast-check needs a plant with vector readings that Holdfast knows");
  }
  ModeCheck check;
  check.likelihood = options.likelihood;
  check.modes = system->source.modes;
  for (const SystemModel& topology : check.modes.topologies) {
    if (!topology.is_linear()) {
      throw UsageError("scenario " + experiment.name + ": the plant is not linear");
    }
  }
  check.num_channels = system->model().num_attack_channels();
  check.num_sensors = system->model().num_measurements();
  for (const PlantMode& mode : check.modes.modes) {
    check.attacked_most = std::max(check.attacked_most, static_cast<int>(mode.channels.size()));
  }
  if (options.attacked_most >= 0) {
    check.attacked_most = std::min(options.attacked_most, check.num_channels);
  }
  for (const SystemModel& model : check.modes.models()) {
    check.theory.push_back(analyse_mode(model));
  }
  find_bad_sets(check);
  find_protecting(check);
  count_models(check);
  const bool exists = std::ranges::all_of(
      check.theory, [](const ModeTheory& mode) { return mode.undetermined_inputs.empty(); });
  if (exists) compare_pairs(*system, options, check);
  if (!exists && check.modes.modes.size() > 1)
    check.notes.push_back("modes were not compared in pairs: some of them have no filter");
  note_what_is_left_out(experiment, *system, options, check);
  return check;
}

}  // namespace holdfast
