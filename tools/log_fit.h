#pragma once

#include <functional>
#include <string>
#include <vector>

#include "estimators/attack_statistics.h"

namespace holdfast {

/// One round of a fit, the 0th with the scenario's guess: the beliefs that it had, and how likely
/// they make the readings: by the filter, which collapses its hypotheses, so that more probable
/// beliefs can come out a little less likely.
struct LogFitRound {
  int round = 0;
  double log_likelihood = 0.0;
  AttackStatistics statistics;
  double change = 0.0;  // largest of a parameter to the next round, relative to its size
  bool is_converged = false;
  std::vector<std::string> unmoved;  // keys of what no round moves from the guess
};

/// What is to be fitted on which log.
struct LogFitOptions {
  std::string log_file;
  std::string name;                           // of an estimator of method attack_mixture
  std::string program = "holdfast-smoother";  // says what of the log is damaged; "": nobody
  int rounds_max = 50;
  double tolerance = 1e-3;                           // of the change, which ends it
  std::function<void(const LogFitRound&)> on_round;  // may be empty
};

/// Fits what an attack_mixture of a log's scenario assumes of attacks by expectation-maximisation,
/// from what the scenario says, with one Gaussian (`components_max` 1) and without learning on the
/// way; returns the last round, which may not have converged. Throws UsageError for a log without
/// scenario or measurement sets, and for an estimator that is not there, of another method, or
/// whose beliefs change with time.
LogFitRound fit_log(const LogFitOptions& options);

/// Keys of what no fit moves from a guess, after which `next` followed: probabilities of 0 or 1,
/// what no reading says anything of, and means that are believed to be exact.
std::vector<std::string> unmoved_beliefs(const AttackStatistics& guess,
                                         const AttackStatistics& next);

/// The block `assumes` of a scenario that says exactly these statistics.
std::string assumes_text(const AttackStatistics& statistics);

}  // namespace holdfast
