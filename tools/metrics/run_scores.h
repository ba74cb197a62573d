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

/// What makes a step count as attacked: a signal attack that is not zero, a frame that a rule
/// touched, or either.
enum class AttackTruth { kAny, kSignals, kFrames };

/// What really happened in one step; spans may be empty when it is not known.
struct TrueStep {
  std::span<const double> state;
  int mode = 0;
  bool is_attacked = false;               // as AttackTruth says, see docs/metrics.md
  std::span<const double> attack_signal;  // all attack signals of the step, one after the other
};

/// Counts of a score from 0 to 1 for positives (attacked) and negatives, in equal bins: adds up
/// exactly over runs, whatever the order.
struct ScoreHistogram {
  static constexpr std::size_t kNumBins = 1000;
  // [kNumBins] each, or empty: an estimator without such scores is not to pay for them in each run.
  std::vector<std::int64_t> positives, negatives;

  void add_counts(std::size_t bin, std::int64_t num_positives, std::int64_t num_negatives);
  void add(double score, bool is_positive);  // NaN and values outside [0, 1] are left out
  void add(const ScoreHistogram& other);
  bool is_empty() const;
};

/// What is kept of one estimator in one run: one curve over the steps for each quantity, NaN where
/// there is none. Curves by name:
///   squared_error.GROUP   sum over the group's states of the squared error
///   nees, nees_rows       e' P^-1 e, and the rows of e
///   nis, nis_rows         innovation' S^-1 innovation, and the innovation's rows
///   attack_probability    as the estimator says
///   mode_correct, mode    1 when the most probable mode is the true one, else 0; the true mode
///   attack_signal_squared_error   at the step to which the input estimate belongs; the sum over
///   the channels, and .1, .2, ... of each channel when there are several
///   components.H, candidates.H    Gaussians of hypothesis H's mixture, after and before reduction
/// A curve that has no value at all is left out.
struct RunScores {
  std::map<std::string, std::vector<double>> curves;  // [num_steps] each
  ScoreHistogram packets;  // of 1 - posterior against the truth of each packet; may stay empty
  std::map<std::string, std::int64_t> outcomes;  // steps with another outcome than ok, by name
};

/// Scores one estimator over one run, step by step; the first estimate of a step counts.
///
/// An estimate that is not finite, a covariance that is not positive definite, and a size that does
/// not fit the truth give no value. An attack signal's estimate is scored against the truth of its
/// input_step, which must have been taken by then.
class RunScorer {
 public:
  /// Precondition: num_steps > 0.
  RunScorer(const std::vector<StateGroup>& groups, std::size_t num_steps);

  /// Steps outside 1..num_steps are ignored. Allocates nothing once it has seen the largest
  /// estimate and a value of each curve. Cost: below 1 us for 4 states.
  void take(const Estimate& estimate, const TrueStep& truth);
  /// For each packet with a posterior of being authentic and a known truth.
  void take_packet(double authentic_probability, bool is_attacked) {
    scores_.packets.add(1.0 - authentic_probability, is_attacked);
  }
  /// Curves without any value are dropped; the scorer is used up.
  RunScores finish();

 private:
  // Places of the curves that every run has; those of the groups follow.
  enum Curve : std::size_t {
    kNees,
    kNeesRows,
    kNis,
    kNisRows,
    kAttackProbability,
    kModeCorrect,
    kMode,
    kAttackSignal,
    kNumCurves
  };

  void set(std::size_t curve, std::size_t row, double value);
  void keep_attack_signal(std::size_t row, std::span<const double> signal);
  void score_state(std::size_t row, const Estimate& estimate, std::span<const double> state);
  void score_mode(std::size_t row, const Estimate& estimate, int mode);
  void score_attack_signal(const Estimate& estimate);
  void score_mixtures(std::size_t row, const Estimate& estimate);
  // x' M^-1 x; NaN unless M is positive definite and all is finite.
  double normalised_square(const Eigen::VectorXd& x, const Eigen::MatrixXd& M);

  std::vector<StateGroup> groups_;
  std::vector<std::size_t> states_needed_;  // by each group
  std::size_t num_steps_;
  std::vector<std::vector<double>> curves_;  // empty without any value
  std::vector<char> is_taken_;
  std::size_t signal_rows_ = 0;
  std::vector<double> signals_;  // [num_steps][signal_rows_], NaN where not known
  std::vector<std::vector<double>> channel_errors_;  // by channel, when there are several
  struct MixtureCurves {
    std::string hypothesis;
    std::vector<double> components, candidates;
  };
  std::vector<MixtureCurves> mixtures_;
  std::array<std::int64_t, 5> outcomes_{};
  Eigen::VectorXd error_;
  std::vector<double> work_;  // of normalised_square
  RunScores scores_;
};

/// "no_packets", "refused_input", ...; "ok" for kOk.
std::string outcome_name(StepOutcome outcome);

}  // namespace holdfast
