#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "estimators/input_state_filter.h"

namespace holdfast {

/// How a ModeBank weighs its modes.
struct ModeBankOptions {
  enum class FloorRule {
    kNormalised,  // normalise, floor, normalise: a lower bound of the probabilities
    kPrinted      // paper 004, Algorithm 2, line 9: floors L mu before it is normalised
  };

  InputStateRule filter;
  double floor = 1e-4;  // eps; 0: none
  FloorRule floor_rule = FloorRule::kNormalised;
  // [N x N], P(next mode j | mode i) in row i; empty: the mode does not change, but for the floor.
  Eigen::MatrixXd transition;
  std::vector<double> start_probability;  // [N]; empty: all alike
};

/// A filter of state and unknown inputs for each mode, and the probability of each mode (paper 004,
/// Algorithm 2; method page, section 1).
///
/// Static: mu_j ~ L_j mu_j, filters run on their own. Dynamic, with a transition matrix: the
/// beliefs are mixed before each step by where a mode comes from, moments matched, as the
/// interacting multiple model does; then mu_j ~ L_j sum_i P(j | i) mu_i.
class ModeBank {
 public:
  enum class Result { kStarted, kCorrected, kDegenerate, kFailed };

  /// Throws UsageError as InputStateFilter does, and for options that do not fit the modes.
  ModeBank(const std::vector<SystemModel>& modes, const ModeBankOptions& options,
           const std::vector<std::string>& names = {});

  /// x at the first step, after its readings; the same for all modes.
  void start(const Gaussian& state);
  /// Rows, y and u as InputStateFilter::step() takes them. kDegenerate: no mode could have been,
  /// and the probabilities stand; kFailed: a filter could not take the step.
  Result step(std::span<const int> rows, const Eigen::VectorXd& y, const Eigen::VectorXd& u);

  int num_modes() const { return static_cast<int>(filters_.size()); }
  /// mu.
  const std::vector<double>& probability() const { return probability_; }
  /// Of the latest step; 0 after the first.
  const std::vector<double>& log_likelihood() const { return log_likelihood_; }
  /// The lowest index among equals.
  int most_probable() const;
  const InputStateFilter& filter(int mode) const {
    return filters_[static_cast<std::size_t>(mode)];
  }
  InputStateFilter& filter(int mode) { return filters_[static_cast<std::size_t>(mode)]; }

 private:
  void mix();
  bool weigh();

  ModeBankOptions options_;
  std::vector<InputStateFilter> filters_;
  std::vector<double> probability_, log_likelihood_, log_weight_;
  std::vector<AnyVector> mixed_means_;
  std::vector<AnyMatrix> mixed_covariances_;
  bool has_started_ = false;
};

}  // namespace holdfast
