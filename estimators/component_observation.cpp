#include "estimators/component_observation.h"

#include <algorithm>

#include "estimators/padded_matrix.h"

namespace holdfast {

ComponentObservation::ComponentObservation(const SystemModel& model, const std::vector<int>& rows,
                                           bool observes_signal,
                                           HybridBernoulliOptions::Update update)
    : model_(model),
      rows_(rows),
      observes_signal_(observes_signal),
      is_unscented_(update == HybridBernoulliOptions::Update::kUnscented),
      inner_(model.num_states() + (observes_signal ? model.num_attack_channels() : 0)),
      jacobian_(model.num_measurements(), model.num_states() + model.num_attack_channels()),
      x_(model.num_states()),
      a_(model.num_attack_channels()),
      y_(model.num_measurements()) {
  const int width = padded::width_of(size());
  C_.resize(static_cast<std::size_t>(size() * padded::width_of(inner_)));
  C_transposed_.resize(static_cast<std::size_t>(inner_ * width));
  R_.resize(static_cast<std::size_t>(size() * width));
  for (int i = 0; i < size(); ++i) {
    for (int j = 0; j < size(); ++j) {
      R_[static_cast<std::size_t>(i * width + j)] =
          model.R(rows[static_cast<std::size_t>(i)], rows[static_cast<std::size_t>(j)]);
    }
  }
  if (!is_linear()) return;
  jacobian_ << model.C, model.H;
  for (int i = 0; i < size(); ++i) set_row(i, jacobian_);
}

void ComponentObservation::set_row(int i, const Eigen::MatrixXd& jacobian) {
  const int width = padded::width_of(size()), own_width = padded::width_of(inner_);
  const int row = rows_[static_cast<std::size_t>(i)];
  for (int j = 0; j < inner_; ++j) {
    C_[static_cast<std::size_t>(i * own_width + j)] = jacobian(row, j);
    C_transposed_[static_cast<std::size_t>(j * width + i)] = jacobian(row, j);
  }
}

void ComponentObservation::load(const double* z) {
  std::copy_n(z, x_.size(), x_.data());
  a_.setZero();
  if (observes_signal_) std::copy_n(z + x_.size(), a_.size(), a_.data());
}

void ComponentObservation::linearise(const double* mean) {
  load(mean);
  model_.measure_jacobian(x_, a_, jacobian_);
  model_.measure(x_, a_, y_);
  for (int i = 0; i < size(); ++i) set_row(i, jacobian_);
}

void ComponentObservation::predict(const double* mean, double* y) const {
  const int width = padded::width_of(size());
  std::fill_n(y, width, 0.0);
  padded::add_combination(1.0, mean, 1, inner_, C_transposed_.data(), width, y, width);
}

void ComponentObservation::predict(const double* mean, const double* covariance, int width,
                                   int dimension, double* y, double* S, double* T) {
  const int own_width = padded::width_of(size());
  if (!is_linear() && is_unscented_) {
    predict_points(mean, covariance, width, dimension, y, S, T);
  } else {
    if (is_linear()) {
      predict(mean, y);
    } else {
      linearise(mean);
      std::fill_n(y, own_width, 0.0);
      for (int i = 0; i < size(); ++i) y[i] = y_[rows_[static_cast<std::size_t>(i)]];
    }
    padded::multiply(C_.data(), padded::width_of(inner_), size(), inner_, covariance, width, T);
    padded::multiply_upper(T, width, size(), inner_, C_transposed_.data(), own_width, S, own_width);
  }
  for (int i = 0; i < size() * own_width; ++i) S[i] += R_[static_cast<std::size_t>(i)];
}

void ComponentObservation::predict_points(const double* mean, const double* covariance, int width,
                                          int dimension, double* y, double* S, double* T) {
  const int own_width = padded::width_of(size());
  points_.set(mean, covariance, width, dimension);
  seen_.assign(static_cast<std::size_t>(points_.count() * own_width), 0.0);
  offset_.assign(static_cast<std::size_t>(width), 0.0);
  std::fill_n(y, own_width, 0.0);
  for (int i = 0; i < points_.count(); ++i) {
    load(points_.point(i));
    model_.measure(x_, a_, y_);
    double* const seen = seen_.data() + i * own_width;
    for (int j = 0; j < size(); ++j) {
      seen[j] = y_[rows_[static_cast<std::size_t>(j)]];
      y[j] += points_.weight(i) * seen[j];
    }
  }
  std::fill_n(S, size() * own_width, 0.0);
  std::fill_n(T, size() * width, 0.0);
  for (int i = 0; i < points_.count(); ++i) {
    double* const seen = seen_.data() + i * own_width;
    for (int j = 0; j < size(); ++j) seen[j] -= y[j];
    for (int j = 0; j < dimension; ++j) {
      offset_[static_cast<std::size_t>(j)] = points_.point(i)[j] - mean[j];
    }
    for (int j = 0; j < size(); ++j) {
      const double factor = points_.weight(i) * seen[j];
      padded::add_row(factor, seen, S + j * own_width, own_width);
      padded::add_row(factor, offset_.data(), T + j * width, width);
    }
  }
}

}  // namespace holdfast
