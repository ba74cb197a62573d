#include "estimators/gaussian_mixture.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "estimators/padded_matrix.h"

namespace holdfast {

GaussianMixture::GaussianMixture(int dimension)
    : dimension_(dimension), width_(padded::width_of(dimension)) {}

double GaussianMixture::weight(int j) const {
  return std::exp(log_weight(j));
}

GaussianMixture::ConstCovariance GaussianMixture::covariance(int j) const {
  return {covariance_data(covariance_index(j)), dimension_, dimension_,
          Eigen::OuterStride<>(width_)};
}

int GaussianMixture::dominant() const {
  const auto largest = std::max_element(log_weights_.begin(), log_weights_.end());
  return largest == log_weights_.end() ? -1 : static_cast<int>(largest - log_weights_.begin());
}

void GaussianMixture::moments(Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) const {
  mean.setZero(dimension_);
  covariance.setZero(dimension_, dimension_);
  const double log_sum = log_sum_exp(log_weights_);
  for (int j = 0; j < size(); ++j) mean += std::exp(log_weight(j) - log_sum) * this->mean(j);
  for (int j = 0; j < size(); ++j) {
    const double share = std::exp(log_weight(j) - log_sum);
    covariance += share * this->covariance(j);
    // Row by row: an outer product of expressions would allocate.
    const double* const m = mean_data(j);
    for (int c = 0; c < dimension_; ++c) {
      for (int i = 0; i < dimension_; ++i) {
        covariance(i, c) += share * (m[i] - mean[i]) * (m[c] - mean[c]);
      }
    }
  }
}

void GaussianMixture::clear() {
  num_covariances_ = 0;
  log_weights_.clear();
  means_.clear();
  covariances_.clear();
  covariance_indices_.clear();
  tags_.clear();
}

int GaussianMixture::add_covariance() {
  covariances_.resize(covariances_.size() + block(1), 0.0);
  return num_covariances_++;
}

int GaussianMixture::add(double log_weight, int covariance_index, const ComponentTag& tag) {
  log_weights_.push_back(log_weight);
  covariance_indices_.push_back(covariance_index);
  tags_.push_back(tag);
  means_.resize(means_.size() + offset(1), 0.0);
  return size() - 1;
}

int GaussianMixture::add(double log_weight, const Eigen::Ref<const Eigen::VectorXd>& mean,
                         const Eigen::Ref<const Eigen::MatrixXd>& covariance,
                         const ComponentTag& tag) {
  const int index = add_covariance();
  const int j = add(log_weight, index, tag);
  this->mean(j) = mean;
  Covariance(covariance_data(index), dimension_, dimension_, Eigen::OuterStride<>(width_)) =
      covariance;
  return j;
}

void GaussianMixture::keep(std::span<const int> components) {
  std::size_t next = 0;
  for (const int component : components) {
    const auto j = static_cast<std::size_t>(component);
    log_weights_[next] = log_weights_[j];
    covariance_indices_[next] = covariance_indices_[j];
    tags_[next] = tags_[j];
    std::copy_n(mean_data(component), width_, mean_data(static_cast<int>(next)));
    ++next;
  }
  log_weights_.resize(next);
  covariance_indices_.resize(next);
  tags_.resize(next);
  means_.resize(next * offset(1));
}

double GaussianMixture::normalise() {
  const double log_sum = log_sum_exp(log_weights_);
  if (std::isfinite(log_sum)) {
    for (double& value : log_weights_) value -= log_sum;
  }
  return log_sum;
}

double log_sum_exp(std::span<const double> values) {
  // A term this far below the largest adds less than rounding does, however many there are.
  constexpr double kNegligible = -60.0;
  if (values.empty()) return -std::numeric_limits<double>::infinity();
  const double largest = *std::max_element(values.begin(), values.end());
  if (!std::isfinite(largest)) return largest;
  double sum = 0.0;
  for (const double value : values) {
    if (value - largest > kNegligible) sum += std::exp(value - largest);
  }
  return largest + std::log(sum);
}

}  // namespace holdfast
