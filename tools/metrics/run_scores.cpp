#include "tools/metrics/run_scores.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "tools/metrics/statistics.h"

namespace holdfast {
namespace {

constexpr std::size_t kMixturesMax = 4;

}  // namespace

void ScoreHistogram::add_counts(std::size_t bin, std::int64_t num_positives,
                                std::int64_t num_negatives) {
  if (positives.empty()) {
    positives.resize(kNumBins, 0);
    negatives.resize(kNumBins, 0);
  }
  positives[bin] += num_positives;
  negatives[bin] += num_negatives;
}

void ScoreHistogram::add(double score, bool is_positive) {
  if (!(score >= 0.0 && score <= 1.0)) return;
  const auto bin = static_cast<std::size_t>(score * static_cast<double>(kNumBins));
  add_counts(std::min(bin, kNumBins - 1), is_positive ? 1 : 0, is_positive ? 0 : 1);
}

void ScoreHistogram::add(const ScoreHistogram& other) {
  for (std::size_t i = 0; i < other.positives.size(); ++i)
    add_counts(i, other.positives[i], other.negatives[i]);
}

bool ScoreHistogram::is_empty() const {
  const auto is_zero = [](std::int64_t count) { return count == 0; };
  return std::all_of(positives.begin(), positives.end(), is_zero) &&
         std::all_of(negatives.begin(), negatives.end(), is_zero);
}

RunScorer::RunScorer(const std::vector<StateGroup>& groups, std::size_t num_steps)
    : groups_(groups),
      num_steps_(num_steps),
      curves_(kNumCurves + groups.size()),
      is_taken_(num_steps, 0) {
  for (const StateGroup& group : groups_) {
    int last = -1;
    for (const int state : group.states) {
      if (state < 0) throw std::invalid_argument("group " + group.name + " has a negative state");
      last = std::max(last, state);
    }
    states_needed_.push_back(static_cast<std::size_t>(last + 1));
  }
}

void RunScorer::set(std::size_t curve, std::size_t row, double value) {
  if (!std::isfinite(value)) return;
  if (curves_[curve].empty()) curves_[curve].assign(num_steps_, kNoValue);
  curves_[curve][row] = value;
}

void RunScorer::take(const Estimate& estimate, const TrueStep& truth) {
  if (estimate.step < 1 || estimate.step > static_cast<std::int64_t>(num_steps_)) return;
  const auto row = static_cast<std::size_t>(estimate.step - 1);
  if (is_taken_[row]) return;
  is_taken_[row] = 1;
  ++outcomes_.at(static_cast<std::size_t>(estimate.outcome));
  keep_attack_signal(row, truth.attack_signal);
  score_state(row, estimate, truth.state);
  if (estimate.innovation.size() > 0) {
    const double nis = normalised_square(estimate.innovation, estimate.innovation_covariance);
    set(kNis, row, nis);
    if (std::isfinite(nis)) set(kNisRows, row, static_cast<double>(estimate.innovation.size()));
  }
  if (estimate.attack_probability >= 0.0 && estimate.attack_probability <= 1.0)
    set(kAttackProbability, row, estimate.attack_probability);
  score_mode(row, estimate, truth.mode);
  score_attack_signal(estimate);
  score_mixtures(row, estimate);
}

// Hypotheses have one order throughout a run; another name ends the row.
void RunScorer::score_mixtures(std::size_t row, const Estimate& estimate) {
  std::size_t place = 0;
  for (const HypothesisEstimate& hypothesis : estimate.hypotheses) {
    if (hypothesis.num_components <= 0) continue;
    if (place == mixtures_.size()) {
      if (place == kMixturesMax) return;
      mixtures_.push_back({hypothesis.name, std::vector<double>(num_steps_, kNoValue),
                           std::vector<double>(num_steps_, kNoValue)});
    }
    MixtureCurves& curves = mixtures_[place++];
    if (curves.hypothesis != hypothesis.name) return;
    curves.components[row] = static_cast<double>(hypothesis.num_components);
    curves.candidates[row] = static_cast<double>(hypothesis.num_candidates);
  }
}

void RunScorer::keep_attack_signal(std::size_t row, std::span<const double> signal) {
  if (signal.empty()) return;
  if (signals_.empty()) {
    signal_rows_ = signal.size();
    signals_.assign(signal_rows_ * num_steps_, kNoValue);
  }
  if (signal.size() != signal_rows_) return;
  std::copy(signal.begin(), signal.end(),
            signals_.begin() + static_cast<std::ptrdiff_t>(row * signal_rows_));
}

void RunScorer::score_state(std::size_t row, const Estimate& estimate,
                            std::span<const double> state) {
  const auto num_states = static_cast<std::size_t>(estimate.mean.size());
  const std::size_t shared = std::min(num_states, state.size());
  if (shared == 0 || !estimate.mean.allFinite()) return;
  const double* mean = estimate.mean.data();
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    if (states_needed_[g] == 0 || states_needed_[g] > shared) continue;
    double sum = 0.0;
    for (const int s : groups_[g].states) {
      const double error = mean[s] - state[static_cast<std::size_t>(s)];
      sum += error * error;
    }
    set(kNumCurves + g, row, sum);
  }
  if (num_states != state.size() || estimate.covariance.rows() != estimate.mean.size()) return;
  error_ = estimate.mean - Eigen::Map<const Eigen::VectorXd>(state.data(), estimate.mean.size());
  const double nees = normalised_square(error_, estimate.covariance);
  set(kNees, row, nees);
  if (std::isfinite(nees)) set(kNeesRows, row, static_cast<double>(num_states));
}

void RunScorer::score_mode(std::size_t row, const Estimate& estimate, int mode) {
  const std::vector<double>& probability = estimate.mode_probability;
  if (probability.empty()) return;
  set(kMode, row, static_cast<double>(mode));
  for (const double p : probability) {
    if (!std::isfinite(p)) return;
  }
  const auto most = std::max_element(probability.begin(), probability.end()) - probability.begin();
  set(kModeCorrect, row, most == mode ? 1.0 : 0.0);
}

void RunScorer::score_attack_signal(const Estimate& estimate) {
  const auto num_rows = static_cast<std::size_t>(estimate.input_mean.size());
  if (num_rows == 0 || num_rows != signal_rows_ || estimate.input_step < 1 ||
      estimate.input_step > static_cast<std::int64_t>(num_steps_)) {
    return;
  }
  const auto row = static_cast<std::size_t>(estimate.input_step - 1);
  const double* truth = &signals_[row * signal_rows_];
  double sum = 0.0;
  for (std::size_t i = 0; i < num_rows; ++i) {
    const double error = estimate.input_mean.data()[i] - truth[i];
    sum += error * error;
    if (num_rows > 1 && std::isfinite(error)) {
      channel_errors_.resize(num_rows);
      channel_errors_[i].resize(num_steps_, kNoValue);
      channel_errors_[i][row] = error * error;
    }
  }
  set(kAttackSignal, row, sum);
}

double RunScorer::normalised_square(const Eigen::VectorXd& x, const Eigen::MatrixXd& M) {
  if (M.rows() != x.size() || M.cols() != x.size()) return kNoValue;
  // Factorised in place, in memory that only grows: anything else would allocate at every step.
  const auto size = static_cast<std::size_t>(x.size());
  if (work_.size() < size * (size + 1)) work_.resize(size * (size + 1));
  Eigen::Map<Eigen::MatrixXd> factor(work_.data(), x.size(), x.size());
  Eigen::Map<Eigen::VectorXd> whitened(work_.data() + size * size, x.size());
  factor = M;
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(factor);
  // A NaN passes for positive, and the solution skips it where the right side is 0.
  if (llt.info() != Eigen::Success || !factor.diagonal().allFinite()) return kNoValue;
  whitened = x;
  factor.triangularView<Eigen::Lower>().solveInPlace(whitened);
  return whitened.squaredNorm();
}

RunScores RunScorer::finish() {
  static constexpr std::array<const char*, kNumCurves> kNames = {"nees",
                                                                 "nees_rows",
                                                                 "nis",
                                                                 "nis_rows",
                                                                 "attack_probability",
                                                                 "mode_correct",
                                                                 "mode",
                                                                 "attack_signal_squared_error"};
  for (std::size_t c = 0; c < curves_.size(); ++c) {
    if (curves_[c].empty()) continue;
    const std::string name =
        c < kNumCurves ? kNames[c] : "squared_error." + groups_[c - kNumCurves].name;
    scores_.curves[name] = std::move(curves_[c]);
  }
  for (std::size_t i = 0; i < channel_errors_.size(); ++i) {
    if (channel_errors_[i].empty()) continue;
    const std::string name = std::string(kNames[kAttackSignal]) + "." + std::to_string(i + 1);
    scores_.curves[name] = std::move(channel_errors_[i]);
  }
  for (MixtureCurves& mixture : mixtures_) {
    scores_.curves["components." + mixture.hypothesis] = std::move(mixture.components);
    scores_.curves["candidates." + mixture.hypothesis] = std::move(mixture.candidates);
  }
  for (std::size_t i = 1; i < outcomes_.size(); ++i) {
    if (outcomes_[i] > 0)
      scores_.outcomes[outcome_name(static_cast<StepOutcome>(i))] = outcomes_[i];
  }
  return std::move(scores_);
}

std::string outcome_name(StepOutcome outcome) {
  switch (outcome) {
    case StepOutcome::kOk:
      return "ok";
    case StepOutcome::kNoPackets:
      return "no_packets";
    case StepOutcome::kRefusedInput:
      return "refused_input";
    case StepOutcome::kFactorisationFailed:
      return "factorisation_failed";
    case StepOutcome::kDegenerateWeights:
      return "degenerate_weights";
  }
  return "outcome_" + std::to_string(static_cast<std::int32_t>(outcome));
}

}  // namespace holdfast
