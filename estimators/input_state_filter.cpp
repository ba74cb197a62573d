#include "estimators/input_state_filter.h"

#include <algorithm>
#include <numeric>

#include "common/errors.h"

namespace holdfast {
namespace {

constexpr double kConverged = 1e-14;
constexpr std::size_t kRowPatternsMax = 256;

std::uint64_t pattern_of(std::span<const int> rows) {
  std::uint64_t pattern = 0;
  for (const int row : rows) pattern |= std::uint64_t{1} << static_cast<unsigned>(row);
  return pattern;
}

// The arithmetic in sizes that are known when compiled, for the papers' plants.
template <int N, int M>
bool run_step(const ModeTransition& transition, const InputStateRule& rule,
              const InputStateCovariances& before, InputStateGains& gains) {
  InputStateStep<N, M> step;
  return step.run(transition, rule, before, gains);
}

bool compute_gains(const ModeTransition& transition, const InputStateRule& rule,
                   const InputStateCovariances& before, InputStateGains& gains) {
  const auto n = transition.to->A.rows();
  const int free = transition.to->num_free();
  if (n == 12 && free == 9) return run_step<12, 9>(transition, rule, before, gains);
  if (n == 5 && free == 2) return run_step<5, 2>(transition, rule, before, gains);
  if (n == 5 && free == 1) return run_step<5, 1>(transition, rule, before, gains);
  return run_step<Eigen::Dynamic, Eigen::Dynamic>(transition, rule, before, gains);
}

void check_size(const SystemModel& model, const SystemModel& first) {
  const std::vector<std::string> problems = model.problems();
  if (!problems.empty()) throw UsageError("model: " + problems.front());
  if (!model.is_linear()) throw UsageError("this filter needs a linear model");
  if (model.num_states() != first.num_states() ||
      model.num_measurements() != first.num_measurements() ||
      model.num_inputs() != first.num_inputs()) {
    throw UsageError("modes must have equal numbers of states, measurements and known inputs");
  }
  if (std::max({model.num_states(), model.num_measurements(), model.num_attack_channels(),
                model.num_inputs()}) > kSmallSizeMax) {
    throw UsageError("this filter takes at most " + std::to_string(kSmallSizeMax) +
                     " states, measurements, inputs and unknown inputs");
  }
}

std::string undetermined_text(const ModeTransition& transition, const SystemModel& model,
                              const std::string& mode_name) {
  std::string names;
  for (const int channel : undetermined_inputs(transition)) {
    const auto index = static_cast<std::size_t>(channel);
    names += (names.empty() ? "" : ", ") + (index < model.attack_names.size()
                                                ? model.attack_names[index]
                                                : std::to_string(channel + 1));
  }
  return "mode '" + mode_name +
         "': no filter exists, since the readings of a step and the next do "
         "not determine the unknown input " +
         names +
         " (rank C2 G2 is below the number of inputs that the output does not show); leave it out "
         "of the mode, or measure what it acts on";
}

}  // namespace

InputStateFilter::InputStateFilter(std::vector<SystemModel> modes, const InputStateRule& rule,
                                   std::vector<std::string> mode_names)
    : models_(std::move(modes)),
      names_(std::move(mode_names)),
      rule_(rule),
      gains_(std::make_unique<InputStateGains>()),
      next_gains_(std::make_unique<InputStateGains>()) {
  if (models_.empty()) throw UsageError("a filter needs a mode");
  for (std::size_t i = names_.size(); i < models_.size(); ++i)
    names_.push_back(std::to_string(i + 1));
  for (const SystemModel& model : models_) check_size(model, models_.front());
  std::vector<int> rows(static_cast<std::size_t>(models_.front().num_measurements()));
  std::iota(rows.begin(), rows.end(), 0);
  // All changes from mode to mode are prepared, so that no step has to. A mode that stays must be
  // determined; where a change is not, the inputs have their prior for one step.
  for (std::size_t i = 0; i < models_.size(); ++i) {
    const DecoupledMode& from = decoupled(static_cast<int>(i), rows);
    for (std::size_t j = 0; j < models_.size(); ++j) {
      current_ = &from;
      const ModeTransition& transition = transition_to(decoupled(static_cast<int>(j), rows));
      if (!transition.is_determined && i == j) {
        throw UsageError(undetermined_text(transition, models_[i], names_[i]));
      }
    }
  }
  current_ = nullptr;
  const Eigen::Index n = num_states();
  start({Eigen::VectorXd::Zero(n), Eigen::MatrixXd::Identity(n, n)});
}

bool InputStateFilter::shows_all_inputs(const SystemModel& mode) {
  std::vector<int> rows(static_cast<std::size_t>(mode.num_measurements()));
  std::iota(rows.begin(), rows.end(), 0);
  return decouple(mode, rows).num_hidden() == 0;
}

void InputStateFilter::start(const Gaussian& state) {
  mean_ = state.mean;
  gains_->after.P = state.covariance;
  current_ = nullptr;
  is_converged_ = false;
}

void InputStateFilter::restart(const Eigen::Ref<const Eigen::VectorXd>& mean,
                               const Eigen::Ref<const Eigen::MatrixXd>& covariance) {
  mean_ = mean;
  gains_->after.P = covariance;
  is_converged_ = false;
  set_seen_input_covariance(*current_, gains_->after);
  see_inputs();
}

const DecoupledMode& InputStateFilter::decoupled(int mode, std::span<const int> rows) {
  std::unique_ptr<DecoupledMode>& entry = decoupled_[{mode, pattern_of(rows)}];
  if (entry == nullptr) {
    entry =
        std::make_unique<DecoupledMode>(decouple(models_[static_cast<std::size_t>(mode)], rows));
  }
  return *entry;
}

const ModeTransition& InputStateFilter::transition_to(const DecoupledMode& to) {
  std::unique_ptr<ModeTransition>& entry = transitions_[{current_, &to}];
  if (entry == nullptr) entry = std::make_unique<ModeTransition>(make_transition(*current_, to));
  return *entry;
}

// Patterns of lost rows may be many: memory stays bounded.
void InputStateFilter::forget_unusual_rows() {
  if (decoupled_.size() + transitions_.size() <=
      kRowPatternsMax + models_.size() * (models_.size() + 1)) {
    return;
  }
  std::erase_if(transitions_, [this](const auto& entry) {
    const auto& [from, to] = entry.first;
    return (!from->is_complete || !to->is_complete) && entry.second.get() != transition_;
  });
  std::erase_if(decoupled_, [this](const auto& entry) {
    return !entry.second->is_complete && entry.second.get() != current_;
  });
}

// Lines 19 to 21: the inputs that this step's output shows.
void InputStateFilter::see_inputs() {
  const DecoupledMode& mode = *current_;
  d1_ = z1_;
  d1_.noalias() -= mode.C1.lazyProduct(mean_);
  if (u_.size() > 0) d1_.noalias() -= mode.D1.lazyProduct(u_);
  d1_.array() *= mode.M1.diagonal().array();
}

bool InputStateFilter::update_gains(const ModeTransition& transition) {
  const bool is_same = transition_ == &transition && transition.from == transition.to &&
                       transition.from->is_complete;
  if (is_converged_ && is_same) return true;
  is_converged_ = false;
  if (!compute_gains(transition, rule_, gains_->after, *next_gains_)) return false;
  if (is_same && may_converge_) {
    const AnyMatrix& P = next_gains_->after.P;
    const double change = (P - gains_->after.P).cwiseAbs().maxCoeff();
    is_converged_ = change <= kConverged * P.cwiseAbs().maxCoeff();
  }
  std::swap(gains_, next_gains_);
  return true;
}

InputStateResult InputStateFilter::step(int mode, std::span<const int> rows,
                                        const Eigen::VectorXd& y, const Eigen::VectorXd& u) {
  forget_unusual_rows();
  const DecoupledMode& to = decoupled(mode, rows);
  InputStateResult result;
  y_.resize(static_cast<Eigen::Index>(rows.size()));
  for (std::size_t i = 0; i < rows.size(); ++i) y_[static_cast<Eigen::Index>(i)] = y[rows[i]];
  if (current_ == nullptr) {
    result.kind = InputStateResult::Kind::kStarted;
    previous_input_.resize(0);
    gains_->Pd.resize(0, 0);
    r_.resize(0);
    transition_ = nullptr;
  } else {
    const DecoupledMode& from = *current_;
    const ModeTransition& transition = transition_to(to);
    if (!update_gains(transition)) return result;
    transition_ = &transition;
    predicted_ = from.A.lazyProduct(mean_);
    if (u_.size() > 0) predicted_.noalias() += from.B.lazyProduct(u_);
    predicted_.noalias() += from.G1.lazyProduct(d1_);
    r_ = to.T2.lazyProduct(y_);
    r_.noalias() -= to.C2.lazyProduct(predicted_);
    if (u.size() > 0) r_.noalias() -= to.D2.lazyProduct(u);
    mean_ = predicted_;
    mean_.noalias() += gains_->Kx.lazyProduct(r_);
    if (rule_.improves_input) d1_.noalias() += gains_->J.lazyProduct(r_);
    previous_input_ = from.V1.lazyProduct(d1_);
    weighted_ = gains_->M2.lazyProduct(r_);
    previous_input_.noalias() += from.V2.lazyProduct(weighted_);
    weighted_ = gains_->W.lazyProduct(r_);
    result.squared_distance = r_.dot(weighted_);
    result.log_likelihood = gains_->log_constant - 0.5 * result.squared_distance;
    result.rank = static_cast<int>(transition.is_determined ? transition.N.cols() : r_.size());
    result.kind = InputStateResult::Kind::kCorrected;
  }
  current_ = &to;
  u_ = u;
  z1_ = to.T1.lazyProduct(y_);
  if (result.kind == InputStateResult::Kind::kStarted) {
    set_seen_input_covariance(to, gains_->after);
  }
  see_inputs();
  return result;
}

}  // namespace holdfast
