#include "estimators/component_motion.h"

#include <algorithm>

#include "estimators/padded_matrix.h"

namespace holdfast {

ComponentMotion::ComponentMotion(const SystemModel& model, HybridBernoulliOptions::Update update)
    : model_(model),
      is_unscented_(update == HybridBernoulliOptions::Update::kUnscented),
      num_states_(model.num_states()),
      num_channels_(model.num_attack_channels()),
      jacobian_(num_states_, num_states_ + num_channels_),
      x_(num_states_),
      a_(num_channels_),
      next_(num_states_) {
  const auto block = static_cast<std::size_t>((num_states_ + num_channels_) *
                                              padded::width_of(num_states_ + num_channels_));
  F_.resize(block);
  F_transposed_.resize(block);
  product_.resize(block);
  if (model.is_linear()) {
    jacobian_ << model.A, model.G;
    linearise(nullptr, Signal::kKept);
  }
}

void ComponentMotion::move(const double* mean, const double* covariance, int width, Signal signal,
                           double* next_mean, double* next_covariance) {
  if (!is_linear() && is_unscented_) {
    return move_points(mean, covariance, width, signal, next_mean, next_covariance);
  }
  if (!is_linear()) linearise(mean, signal);
  move_linearly(mean, covariance, width, signal, next_mean, next_covariance);
}

// F and its transpose; a linear model's hold for every mean.
void ComponentMotion::linearise(const double* mean, Signal signal) {
  if (mean != nullptr) {
    load(mean, num_states_ + (signal == Signal::kNone ? 0 : num_channels_));
    model_.move_jacobian(x_, a_, jacobian_);
    model_.move(x_, a_, next_);
  }
  const int size = num_states_ + num_channels_, width = padded::width_of(size);
  std::fill(F_.begin(), F_.end(), 0.0);
  std::fill(F_transposed_.begin(), F_transposed_.end(), 0.0);
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < size; ++j) {
      const double value = i < num_states_ ? jacobian_(i, j) : (i == j ? 1.0 : 0.0);
      F_[static_cast<std::size_t>(i * width + j)] = value;
      F_transposed_[static_cast<std::size_t>(j * width + i)] = value;
    }
  }
}

void ComponentMotion::load(const double* mean, int size) {
  std::copy_n(mean, num_states_, x_.data());
  a_.setZero();
  std::copy_n(mean + num_states_, size - num_states_, a_.data());
}

void ComponentMotion::add_noise(double* next_covariance, int width) const {
  for (int i = 0; i < num_states_; ++i) {
    for (int j = 0; j < num_states_; ++j) next_covariance[i * width + j] += model_.Q(i, j);
  }
}

void ComponentMotion::move_linearly(const double* mean, const double* covariance, int width,
                                    Signal signal, double* next_mean, double* next_covariance) {
  const int inner = num_states_ + (signal == Signal::kNone ? 0 : num_channels_);
  const int rows = dimension(signal), next_width = padded::width_of(rows);
  const int own_width = padded::width_of(num_states_ + num_channels_);
  std::fill_n(next_mean, next_width, 0.0);
  if (is_linear()) {
    padded::add_combination(1.0, mean, 1, inner, F_transposed_.data(), own_width, next_mean,
                            next_width);
    // Columns of F' beyond the rows asked for are not padding.
    std::fill(next_mean + rows, next_mean + next_width, 0.0);
  } else {
    std::copy_n(next_.data(), num_states_, next_mean);
    if (signal == Signal::kKept) std::copy_n(a_.data(), num_channels_, next_mean + num_states_);
  }
  if (covariance == nullptr) return;
  product_.resize(static_cast<std::size_t>(rows * width));
  padded::multiply(F_.data(), own_width, rows, inner, covariance, width, product_.data());
  padded::multiply_upper(product_.data(), width, rows, inner, F_transposed_.data(), own_width,
                         next_covariance, next_width);
  for (int i = 0; i < rows; ++i) {
    double* const row = next_covariance + i * next_width;
    std::fill(row + rows, row + next_width, 0.0);
  }
  add_noise(next_covariance, next_width);
  padded::mirror_upper(next_covariance, next_width, rows);
}

void ComponentMotion::move_points(const double* mean, const double* covariance, int width,
                                  Signal signal, double* next_mean, double* next_covariance) {
  const int inner = num_states_ + (signal == Signal::kNone ? 0 : num_channels_);
  const int rows = dimension(signal), next_width = padded::width_of(rows);
  points_.set(mean, covariance, width, inner);
  moved_.assign(static_cast<std::size_t>(points_.count() * next_width), 0.0);
  std::fill_n(next_mean, next_width, 0.0);
  for (int i = 0; i < points_.count(); ++i) {
    load(points_.point(i), inner);
    model_.move(x_, a_, next_);
    double* const moved = moved_.data() + i * next_width;
    std::copy_n(next_.data(), num_states_, moved);
    if (signal == Signal::kKept) std::copy_n(a_.data(), num_channels_, moved + num_states_);
    for (int j = 0; j < rows; ++j) next_mean[j] += points_.weight(i) * moved[j];
  }
  std::fill_n(next_covariance, rows * next_width, 0.0);
  for (int i = 0; i < points_.count(); ++i) {
    double* const moved = moved_.data() + i * next_width;
    for (int j = 0; j < rows; ++j) moved[j] -= next_mean[j];
    for (int j = 0; j < rows; ++j) {
      const double factor = points_.weight(i) * moved[j];
      padded::add_row(factor, moved, next_covariance + j * next_width, next_width);
    }
  }
  add_noise(next_covariance, next_width);
  padded::mirror_upper(next_covariance, next_width, rows);
}

}  // namespace holdfast
