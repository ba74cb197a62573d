#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "estimators/input_state_gains.h"
#include "estimators/kalman_core.h"

namespace holdfast {

/// How a step of an InputStateFilter went.
struct InputStateResult {
  enum class Kind {
    kStarted,  // the first step: the start was taken as the state after its readings
    kCorrected,
    kFailed  // a covariance could not be factorised; the belief stands as it was
  };

  Kind kind = Kind::kFailed;
  double log_likelihood = 0.0;    // of the free output, by the rule's likelihood; 0 when started
  double squared_distance = 0.0;  // nu' R2*^+ nu, chi-square with `rank` degrees of freedom
  int rank = 0;
};

/// Unbiased minimum-variance filter of state and unknown inputs (ULISE, paper 004, Algorithm 1; the
/// form without pseudo-inverse of the method page, section 1).
///
/// Inputs that the output shows at once (through H) are estimated in the same step, the others one
/// step later, so that the whole d of a step is known after the next one. Several modes may take
/// turns: each step says which one holds. Without unknown inputs it is the Kalman filter.
///
/// Rows that do not arrive leave the output. Where the rest does not determine an input, that has
/// the prior N(0, input_std^2) for the step, instead of none.
///
/// Steps with the same mode and all rows converge: gains are kept once the covariance moves by less
/// than 1e-14 of itself in a step.
class InputStateFilter {
 public:
  /// modes: linear, of equal numbers of states and measurements, at most kSmallSizeMax of each and
  /// of inputs. Throws UsageError for a mode with problems(), or in which the filter does not
  /// exist, naming the input that neither this step's nor the next one's readings show.
  InputStateFilter(std::vector<SystemModel> modes, const InputStateRule& rule,
                   std::vector<std::string> mode_names = {});

  /// True when H has full column rank: the readings of a step show all its inputs.
  static bool shows_all_inputs(const SystemModel& mode);

  /// x at the first step, after its readings.
  void start(const Gaussian& state);
  /// Other moments of the state after the latest step; the inputs seen at once follow from its
  /// readings. For banks that mix.
  void restart(const Eigen::Ref<const Eigen::VectorXd>& mean,
               const Eigen::Ref<const Eigen::MatrixXd>& covariance);

  /// y: of all rows, those not in `rows` are not looked at. rows ascend. u: known inputs [q] of
  /// this step. Allocates nothing when these rows were met before.
  InputStateResult step(int mode, std::span<const int> rows, const Eigen::VectorXd& y,
                        const Eigen::VectorXd& u);

  int num_states() const { return models_.front().num_states(); }
  const AnyVector& mean() const { return mean_; }
  const AnyMatrix& covariance() const { return gains_->after.P; }
  /// Of the step before, by the channels of its mode; empty after the first step.
  const AnyVector& previous_input() const { return previous_input_; }
  const AnyMatrix& previous_input_covariance() const { return gains_->Pd; }
  /// Of this step: what the output shows of it at once, and which part of d that is.
  const AnyVector& seen_input() const { return d1_; }
  const AnyMatrix& seen_input_covariance() const { return gains_->after.Pd1; }
  const DecoupledMode& current() const { return *current_; }
  /// r of the latest step, its covariance and gains.
  const AnyVector& innovation() const { return r_; }
  const InputStateGains& gains() const { return *gains_; }
  const ModeTransition& transition() const { return *transition_; }
  /// True while the gains of the step before serve.
  bool is_converged() const { return is_converged_; }
  /// Makes every step compute its gains anew; for tests and comparisons.
  void never_converge() { may_converge_ = false; }

 private:
  using GainsFunction = bool (*)(const ModeTransition&, const InputStateRule&,
                                 const InputStateCovariances&, InputStateGains&);

  const DecoupledMode& decoupled(int mode, std::span<const int> rows);
  const ModeTransition& transition_to(const DecoupledMode& to);
  bool update_gains(const ModeTransition& transition);
  void see_inputs();
  void forget_unusual_rows();

  std::vector<SystemModel> models_;
  std::vector<std::string> names_;
  InputStateRule rule_;
  std::map<std::pair<int, std::uint64_t>, std::unique_ptr<DecoupledMode>> decoupled_;
  std::map<std::pair<const DecoupledMode*, const DecoupledMode*>, std::unique_ptr<ModeTransition>>
      transitions_;
  const DecoupledMode* current_ = nullptr;
  const ModeTransition* transition_ = nullptr;
  std::unique_ptr<InputStateGains> gains_, next_gains_;
  bool may_converge_ = true, is_converged_ = false;

  AnyVector mean_, d1_, previous_input_, r_, z1_, y_, u_, predicted_, weighted_;
};

}  // namespace holdfast
