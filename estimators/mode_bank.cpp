#include "estimators/mode_bank.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "common/errors.h"

namespace holdfast {
namespace {

// Rows of probabilities, as far as rounding in a scenario file lets them be.
void check_transition(const Eigen::MatrixXd& transition, Eigen::Index num_modes) {
  if (transition.rows() != num_modes || transition.cols() != num_modes) {
    throw UsageError("transition must have a row and a column for each of the " +
                     std::to_string(num_modes) + " modes");
  }
  for (Eigen::Index i = 0; i < num_modes; ++i) {
    if (transition.row(i).minCoeff() >= 0.0 && std::abs(transition.row(i).sum() - 1.0) < 1e-9) {
      continue;
    }
    throw UsageError("transition: row " + std::to_string(i + 1) +
                     " must be probabilities that sum to 1");
  }
}

void normalise(std::vector<double>& weights) {
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  for (double& weight : weights) weight /= sum;
}

}  // namespace

ModeBank::ModeBank(const std::vector<SystemModel>& modes, const ModeBankOptions& options,
                   const std::vector<std::string>& names)
    : options_(options),
      probability_(options.start_probability),
      log_likelihood_(modes.size(), 0.0),
      log_weight_(modes.size(), 0.0) {
  if (modes.empty()) throw UsageError("a bank needs at least one mode");
  const auto count = static_cast<double>(modes.size());
  if (!(options.floor >= 0.0 && options.floor * count < 1.0)) {
    throw UsageError("floor must be at least 0 and below 1 / number of modes");
  }
  if (options_.transition.size() > 0) {
    check_transition(options_.transition, static_cast<Eigen::Index>(modes.size()));
    mixed_means_.resize(modes.size());
    mixed_covariances_.resize(modes.size());
  }
  if (probability_.empty()) probability_.assign(modes.size(), 1.0 / count);
  if (probability_.size() != modes.size()) throw UsageError("one start probability for each mode");
  filters_.reserve(modes.size());
  for (std::size_t j = 0; j < modes.size(); ++j) {
    filters_.emplace_back(
        std::vector<SystemModel>{modes[j]}, options.filter,
        std::vector<std::string>{j < names.size() ? names[j] : std::to_string(j + 1)});
  }
}

void ModeBank::start(const Gaussian& state) {
  has_started_ = false;
  for (InputStateFilter& filter : filters_) filter.start(state);
}

// Where each mode's belief comes from; a mode that cannot be goes on from its own past.
void ModeBank::mix() {
  const auto count = filters_.size();
  const auto from_to = [this](std::size_t i, std::size_t j) {
    return options_.transition(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) *
           probability_[i];
  };
  for (std::size_t j = 0; j < count; ++j) {
    double total = 0.0;
    for (std::size_t i = 0; i < count; ++i) total += from_to(i, j);
    log_weight_[j] = std::log(total);
    AnyVector& mean = mixed_means_[j];
    AnyMatrix& covariance = mixed_covariances_[j];
    const InputStateFilter& own = filters_[j];
    if (!(total > 0.0)) {
      mean = own.mean();
      covariance = own.covariance();
      continue;
    }
    mean.setZero(own.mean().size());
    covariance.setZero(mean.size(), mean.size());
    for (std::size_t i = 0; i < count; ++i) mean += (from_to(i, j) / total) * filters_[i].mean();
    for (std::size_t i = 0; i < count; ++i) {
      const double weight = from_to(i, j) / total;
      if (weight == 0.0) continue;
      const AnyVector apart = filters_[i].mean() - mean;
      covariance += weight * filters_[i].covariance();
      covariance.noalias() += (weight * apart) * apart.transpose();
    }
    symmetrise_small(covariance);
  }
  for (std::size_t j = 0; j < count; ++j) {
    filters_[j].restart(mixed_means_[j], mixed_covariances_[j]);
  }
}

bool ModeBank::weigh() {
  for (std::size_t j = 0; j < log_weight_.size(); ++j) log_weight_[j] += log_likelihood_[j];
  const double largest = *std::max_element(log_weight_.begin(), log_weight_.end());
  if (!std::isfinite(largest)) return false;
  if (options_.floor_rule == ModeBankOptions::FloorRule::kPrinted) {
    // As printed, in plain numbers: whether the floor bites depends on the units of y.
    for (double& weight : log_weight_) {
      weight = std::max(std::min(std::exp(weight), 1e300), options_.floor);
    }
    if (std::accumulate(log_weight_.begin(), log_weight_.end(), 0.0) == 0.0) return false;
    probability_ = log_weight_;
    normalise(probability_);
    return true;
  }
  for (std::size_t j = 0; j < log_weight_.size(); ++j) {
    probability_[j] = std::exp(log_weight_[j] - largest);
  }
  normalise(probability_);
  if (options_.floor > 0.0) {
    for (double& probability : probability_) probability = std::max(probability, options_.floor);
    normalise(probability_);
  }
  return true;
}

ModeBank::Result ModeBank::step(std::span<const int> rows, const Eigen::VectorXd& y,
                                const Eigen::VectorXd& u) {
  const bool is_mixed = options_.transition.size() > 0 && has_started_;
  if (is_mixed) {
    mix();
  } else {
    std::transform(probability_.begin(), probability_.end(), log_weight_.begin(),
                   [](double probability) { return std::log(probability); });
  }
  bool has_failed = false;
  for (std::size_t j = 0; j < filters_.size(); ++j) {
    const InputStateResult result = filters_[j].step(0, rows, y, u);
    const bool is_bad =
        result.kind == InputStateResult::Kind::kFailed || std::isnan(result.log_likelihood);
    has_failed = has_failed || is_bad;
    log_likelihood_[j] = is_bad ? -std::numeric_limits<double>::infinity() : result.log_likelihood;
  }
  if (!has_started_) {
    has_started_ = true;
    return has_failed ? Result::kFailed : Result::kStarted;
  }
  if (!weigh()) return has_failed ? Result::kFailed : Result::kDegenerate;
  return has_failed ? Result::kFailed : Result::kCorrected;
}

int ModeBank::most_probable() const {
  return static_cast<int>(std::max_element(probability_.begin(), probability_.end()) -
                          probability_.begin());
}

}  // namespace holdfast
