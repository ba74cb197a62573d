#pragma once

#include <Eigen/Core>
#include <limits>
#include <span>
#include <vector>

namespace holdfast {

/// Which hypothesis a component of a hybrid Bernoulli mixture stands for, beside its Gaussian.
struct ComponentTag {
  int attack_model = -1;      // index into the options' attack_models, -1: none
  bool was_attacked = false;  // the step before: its a_{k-1} is part of the component
  double delivered = 0.0;     // alpha of the beta density of the delivery probability, when
  double lost = 0.0;          // it is estimated, and beta; both 0 when it is known
  int origin = -1;            // entry of the PacketHistory of this step, -1: none
};

/// A Gaussian mixture in contiguous storage: log weights, means, and covariances by index.
///
/// Components may share a covariance: all children of one parent do, and so do the children of
/// parents that share theirs. Rows are padded to a multiple of four numbers; padding is zero.
/// Symbols: d dimension, J components.
class GaussianMixture {
 public:
  using ConstMean = Eigen::Map<const Eigen::VectorXd>;
  using Mean = Eigen::Map<Eigen::VectorXd>;
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  using ConstCovariance = Eigen::Map<const RowMajor, Eigen::Unaligned, Eigen::OuterStride<>>;
  using Covariance = Eigen::Map<RowMajor, Eigen::Unaligned, Eigen::OuterStride<>>;

  /// dimension >= 1.
  explicit GaussianMixture(int dimension = 1);

  int dimension() const { return dimension_; }
  /// Numbers per row in storage, a multiple of four.
  int width() const { return width_; }
  int size() const { return static_cast<int>(log_weights_.size()); }
  int num_covariances() const { return num_covariances_; }

  double log_weight(int j) const { return log_weights_[static_cast<std::size_t>(j)]; }
  double weight(int j) const;
  ConstMean mean(int j) const { return {mean_data(j), dimension_}; }
  ConstCovariance covariance(int j) const;
  int covariance_index(int j) const { return covariance_indices_[static_cast<std::size_t>(j)]; }
  const ComponentTag& tag(int j) const { return tags_[static_cast<std::size_t>(j)]; }
  /// The component of the largest weight, the first of equal ones; -1 when there is none.
  int dominant() const;
  /// Mean [d] and covariance [d x d] of the whole mixture; weights need not sum to one.
  void moments(Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) const;

  /// Empties the mixture and keeps its memory.
  void clear();
  /// A new covariance of zeros; its index.
  int add_covariance();
  /// A new component whose mean is zero; its index.
  int add(double log_weight, int covariance_index, const ComponentTag& tag = {});
  /// A new component with a covariance of its own; its index. Sizes [d], [d x d].
  int add(double log_weight, const Eigen::Ref<const Eigen::VectorXd>& mean,
          const Eigen::Ref<const Eigen::MatrixXd>& covariance, const ComponentTag& tag = {});
  /// Drops every component that is not in the ascending list.
  void keep(std::span<const int> components);
  /// Shifts the log weights so that the weights sum to one; returns the logarithm of their sum
  /// before. Nothing changes when that is -infinity.
  double normalise();

  void set_log_weight(int j, double value) { log_weights_[static_cast<std::size_t>(j)] = value; }
  void set_tag(int j, const ComponentTag& tag) { tags_[static_cast<std::size_t>(j)] = tag; }
  Mean mean(int j) { return {mean_data(j), dimension_}; }
  double* mean_data(int j) { return means_.data() + offset(j); }
  const double* mean_data(int j) const { return means_.data() + offset(j); }
  double* covariance_data(int index) { return covariances_.data() + block(index); }
  const double* covariance_data(int index) const { return covariances_.data() + block(index); }
  std::span<const double> log_weights() const { return log_weights_; }

 private:
  std::size_t offset(int j) const { return static_cast<std::size_t>(j * width_); }
  std::size_t block(int index) const {
    return static_cast<std::size_t>(index) * static_cast<std::size_t>(dimension_ * width_);
  }

  int dimension_, width_;
  int num_covariances_ = 0;
  std::vector<double> log_weights_, means_, covariances_;
  std::vector<int> covariance_indices_;
  std::vector<ComponentTag> tags_;
};

/// log 0.
inline constexpr double kImpossible = -std::numeric_limits<double>::infinity();

/// log sum exp of the values; kImpossible when there are none.
double log_sum_exp(std::span<const double> values);

}  // namespace holdfast
