#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "estimators/estimate.h"

namespace holdfast {

/// States whose error is one number in every table.
struct StateGroup {
  std::string name;
  std::vector<int> states;
  std::string unit;
  double lost_above = 0.0;  // error above which the track counts as lost; 0: no such bound
};

/// What really happened in one step; spans may be empty when it is not known.
struct TrueStep {
  std::span<const double> state;
  int mode = 0;
  bool is_attacked = false;               // any sensor, signal or frame of that step
  std::span<const double> attack_signal;  // all attack signals of the step, one after the other
};

/// Counts of a score from 0 to 1 for positives (attacked) and negatives, in equal bins: adds up
/// exactly over runs, whatever the order.
struct ScoreHistogram {
  static constexpr std::size_t kNumBins = 1000;
  std::vector<std::int64_t> positives = std::vector<std::int64_t>(kNumBins, 0);
  std::vector<std::int64_t> negatives = std::vector<std::int64_t>(kNumBins, 0);

  void add(double score, bool is_positive);  // NaN and values outside [0, 1] are left out
  void add(const ScoreHistogram& other);
  bool is_empty() const;
};

/// What is kept of one estimator in one run: one curve over the steps for each quantity, NaN where
/// there is none. Curves by name:
///   squared_error.GROUP   sum over the group's states of the squared error
///   nees                  e' P^-1 e
///   nis, nis_rows         innovation' S^-1 innovation, and the innovation's rows
///   attack_probability    as the estimator says
///   mode_correct          1 when the most probable mode is the true one, else 0
///   attack_signal_squared_error   at the step to which the input estimate belongs
/// A curve that has no value at all is left out.
struct RunScores {
  std::map<std::string, std::vector<double>> curves;  // [num_steps] each
  ScoreHistogram packets;  // of 1 - posterior against the truth of each packet; may stay empty
  std::map<std::string, std::int64_t> outcomes;  // steps with another outcome than ok, by name
};

/// Scores one estimator over one run, step by step in any order of calls with increasing steps.
class RunScorer {
 public:
  /// Precondition: states of the groups are below the number of states, num_steps > 0.
  RunScorer(const std::vector<StateGroup>& groups, std::size_t num_steps);

  /// Steps outside 1..num_steps are ignored. Allocates nothing in the steady state but for what a
  /// covariance's factorisation needs.
  void take(const Estimate& estimate, const TrueStep& truth);
  /// Curves without any value are dropped; the scorer is used up.
  RunScores finish();

 private:
  std::vector<StateGroup> groups_;
  std::size_t num_steps_;
  RunScores scores_;
};

/// "no_packets", "refused_input", ...; "ok" for kOk.
std::string outcome_name(StepOutcome outcome);

}  // namespace holdfast
