#pragma once

#include <complex>
#include <cstdint>
#include <functional>
#include <vector>

#include "common/models/system_model.h"
#include "estimators/input_state_filter.h"

namespace holdfast {

/// What no estimator of a mode can change (paper 004, section IV-B).
struct ModeTheory {
  // Invariant zeros: where the system matrix [A - zI, G; C, H] loses column rank, by falling
  // absolute value. An attack along one of them can stay invisible.
  std::vector<std::complex<double>> zeros;
  // The system matrix has full column rank for almost every z; else some attack is never seen.
  bool is_invertible = false;
  // By channel: a filter with a delay of one step would need these to be determined, and they are
  // not. Empty when the filter exists.
  std::vector<int> undetermined_inputs;

  /// All zeros lie inside the unit circle: attacks are corrected in the long run (13).
  bool is_strongly_detectable() const {
    return is_invertible && (zeros.empty() || std::abs(zeros.front()) < 1.0 - 1e-9);
  }
  bool is_correctable() const { return is_strongly_detectable() && undetermined_inputs.empty(); }
};

/// Precondition: the model is linear and has no problems().
ModeTheory analyse_mode(const SystemModel& mode);

/// Models that must be considered when at most p signals are attacked, na of ta actuators and ns of
/// ts sensors at most, in tm topologies: sets that no other one contains (Theorem 2 and Remark 2,
/// whose printed sum also counts sets that others contain; method page, erratum 8).
double num_models_needed(int tm, int ta, int ts, int p, int na, int ns);

/// Signals of a scenario at a step: attack by channel of a mode, known inputs.
struct ModeSignals {
  std::function<Eigen::VectorXd(std::int64_t step)> attack, input;
};

/// How well the modes' filters explain readings of a plant in one mode.
struct ModeDivergence {
  /// E[log L of the true mode's filter - log L of the rival's], steps 2, 3, ...; infinite
  /// once the rival's error has grown beyond all bounds, NaN where the true filter's has.
  std::vector<double> log_ratio;

  /// Mean over the second half of the steps.
  double per_step() const;
  /// Steps until the expected odds from even ones are 99 to 1 for good; -1 when they never
  /// are, or that is not known.
  int delay_steps() const;
};

/// Means and covariances of truth and filters, step by step, from a start that all know.
ModeDivergence find_divergence(const SystemModel& truth, const SystemModel& rival,
                               const InputStateRule& rule, const Gaussian& start,
                               const ModeSignals& signals, int num_steps);

}  // namespace holdfast
