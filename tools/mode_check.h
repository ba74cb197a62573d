#pragma once

#include <string>
#include <vector>

#include "common/models/mode_set.h"
#include "estimators/mode_theory.h"
#include "tools/experiment.h"

namespace holdfast {

struct ModeCheckOptions {
  int attacked_most = -1;  // channels attacked at once; -1: the most that a mode lists
  int num_steps = 300;     // over which modes are compared
  InputLikelihood likelihood = InputLikelihood::kPaper;  // by which they are
  double input_std = 1e4;                                // of unknown inputs, for kEvidence
};

/// A set of channels of which no estimator, or not this filter, can correct every attack.
struct BadSet {
  std::string topology;
  std::vector<int> channels;
  ModeTheory theory;
};

/// What can be said of a scenario's attacks before any run.
struct ModeCheck {
  /// Pairs are compared up to this number of modes: there are as many filters as pairs.
  static constexpr std::size_t kComparedMax = 40;
  /// Sets of channels are looked at up to this number.
  static constexpr double kSetsMax = 20000;

  struct Pair {
    int truth = 0, rival = 0;
    // Readings that some attack in the one and some in the other explain alike for ever leave no
    // doubt about the state.
    bool is_distinguishable = false;
    ModeDivergence attacked, quiet;  // with the scenario's attacks; with none
  };

  ModeSet modes;
  std::vector<ModeTheory> theory;         // of each mode
  int num_channels = 0, num_sensors = 0;  // l
  int attacked_most = 0;
  int correctable_most = 0;  // largest p such that any p channels are correctable; -1: not known
  bool is_cut = false;       // larger sets may be correctable, too: they are too many to look at
  std::vector<std::string> notes;  // of what the numbers leave out
  std::vector<BadSet>
      bad_sets;  // of at most attacked_most channels, smallest first, none in another
  std::vector<int> protecting;  // single channels without which no bad set is left
  double models_needed = 0.0;   // Theorem 2, for attacked_most
  InputLikelihood likelihood = InputLikelihood::kPaper;
  std::vector<Pair> pairs;  // empty when there are too many modes
};

/// Analyses the modes of a scenario's plant. Throws UsageError for a plant that has none: one with
/// binary sensors, an outside program, or a nonlinear one.
ModeCheck check_modes(const Experiment& experiment, const ModeCheckOptions& options);

/// In plain words, warnings last.
std::string to_text(const ModeCheck& check);
std::string to_json(const ModeCheck& check);
/// One line for each thing that goes wrong; none when all is well.
std::vector<std::string> warnings_of(const ModeCheck& check);

}  // namespace holdfast
