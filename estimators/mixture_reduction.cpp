#include "estimators/mixture_reduction.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "estimators/padded_matrix.h"

namespace holdfast {

MixtureReduction::MixtureReduction(const HybridBernoulliOptions& options)
    : merge_below_(options.merge_below),
      metric_(options.merge_metric),
      components_max_(options.components_max) {}

void MixtureReduction::reduce(const GaussianMixture& mixture, GaussianMixture& reduced,
                              PacketHistory* history) {
  reduced.clear();
  const int width = mixture.width(), dimension = mixture.dimension();
  order_.resize(static_cast<std::size_t>(mixture.size()));
  std::iota(order_.begin(), order_.end(), 0);
  std::sort(order_.begin(), order_.end(), [&](int left, int right) {
    const double a = mixture.log_weight(left), b = mixture.log_weight(right);
    return a > b || (a == b && left < right);
  });
  factor_of_.assign(static_cast<std::size_t>(mixture.num_covariances()), -1);
  copy_of_ = factor_of_;
  factors_.clear();
  difference_.resize(static_cast<std::size_t>(width));
  is_taken_.assign(order_.size(), 0);
  for (std::size_t first = 0; first < order_.size(); ++first) {
    if (is_taken_[first] != 0) continue;
    cluster_.assign(1, order_[first]);
    if (merge_below_ > 0.0) gather(mixture, first);
    merge(mixture, reduced, dimension, width);
    if (history != nullptr && cluster_.size() > 1) record_merged(mixture, reduced, *history);
  }
  cap(reduced, history);
  reduced.normalise();
}

// Whitening factor of a covariance, made when first asked for; each takes d rows and d reciprocals.
const double* MixtureReduction::factor(const GaussianMixture& mixture, int index) {
  const int width = mixture.width(), dimension = mixture.dimension();
  const auto block = static_cast<std::size_t>((dimension + 1) * width);
  int& place = factor_of_[static_cast<std::size_t>(index)];
  if (place < 0) {
    place = static_cast<int>(factors_.size() / block);
    factors_.resize(factors_.size() + block);
    double* const U = factors_.data() + static_cast<std::size_t>(place) * block;
    std::copy_n(mixture.covariance_data(index), dimension * width, U);
    padded::factorise(U, width, dimension, U + dimension * width, padded::Pivots::kNonNegative);
  }
  return factors_.data() + static_cast<std::size_t>(place) * block;
}

// x' P^-1 x is at least x_i^2 / P_ii for each i (Cauchy and Schwarz; P positive definite, or zero
// along an axis), so most pairs need no factor. Rounding may not decide: who is near the limit is
// measured.
bool MixtureReduction::is_far(const GaussianMixture& mixture, int dominant, int other) const {
  constexpr double kRounding = 1.0 + 1e-6;
  const int width = mixture.width(), dimension = mixture.dimension();
  const double* const P =
      mixture.covariance_data(mixture.covariance_index(measuring(dominant, other)));
  const double* const a = mixture.mean_data(dominant);
  const double* const b = mixture.mean_data(other);
  const double limit = kRounding * merge_below_;
  bool is_beyond = false;
  for (int i = 0; i < dimension; ++i) {
    const double difference = b[i] - a[i], variance = P[i * width + i];
    is_beyond |= variance > 0.0 && difference * difference > limit * variance;
  }
  return is_beyond;
}

double MixtureReduction::squared_distance(const GaussianMixture& mixture, int dominant, int other) {
  const int width = mixture.width(), dimension = mixture.dimension();
  const double* const U = factor(mixture, mixture.covariance_index(measuring(dominant, other)));
  const double* const reciprocals = U + dimension * width;
  const double* const a = mixture.mean_data(dominant);
  const double* const b = mixture.mean_data(other);
  double* const x = difference_.data();
  for (int i = 0; i < dimension; ++i) x[i] = b[i] - a[i];
  double sum = 0.0;
  for (int i = 0; i < dimension && sum <= merge_below_; ++i) {
    x[i] *= reciprocals[i];
    sum += x[i] * x[i];
    const double* const row = U + i * width;
    for (int j = i + 1; j < dimension; ++j) x[j] -= row[j] * x[i];
  }
  return sum;
}

void MixtureReduction::gather(const GaussianMixture& mixture, std::size_t first) {
  const int dominant = order_[first];
  const ComponentTag& tag = mixture.tag(dominant);
  for (std::size_t i = first + 1; i < order_.size(); ++i) {
    if (is_taken_[i] != 0) continue;
    const ComponentTag& other = mixture.tag(order_[i]);
    if (other.attack_model != tag.attack_model || other.was_attacked != tag.was_attacked) continue;
    if (is_far(mixture, dominant, order_[i]) ||
        squared_distance(mixture, dominant, order_[i]) > merge_below_) {
      continue;
    }
    is_taken_[i] = 1;
    cluster_.push_back(order_[i]);
  }
}

// One component of the cluster's weight, mean and covariance; the same for the beta densities.
void MixtureReduction::merge(const GaussianMixture& mixture, GaussianMixture& reduced,
                             int dimension, int width) {
  const int dominant = cluster_.front();
  if (cluster_.size() == 1) {
    const int old = mixture.covariance_index(dominant);
    int& copy = copy_of_[static_cast<std::size_t>(old)];
    if (copy < 0) {
      copy = reduced.add_covariance();
      std::copy_n(mixture.covariance_data(old), dimension * width, reduced.covariance_data(copy));
    }
    const int j = reduced.add(mixture.log_weight(dominant), copy, mixture.tag(dominant));
    std::copy_n(mixture.mean_data(dominant), width, reduced.mean_data(j));
    return;
  }
  const int index = reduced.add_covariance();
  double* const P = reduced.covariance_data(index);
  shares_.clear();
  for (const int i : cluster_) shares_.push_back(mixture.log_weight(i));
  const double log_sum = log_sum_exp(shares_);
  const int j = reduced.add(log_sum, index, mixture.tag(dominant));
  double* const mean = reduced.mean_data(j);
  for (std::size_t c = 0; c < cluster_.size(); ++c) {
    shares_[c] = std::exp(shares_[c] - log_sum);
    const double* const m = mixture.mean_data(cluster_[c]);
    for (int i = 0; i < width; ++i) mean[i] += shares_[c] * m[i];
  }
  double* const x = difference_.data();
  for (std::size_t c = 0; c < cluster_.size(); ++c) {
    const double* const m = mixture.mean_data(cluster_[c]);
    const double* const other = mixture.covariance_data(mixture.covariance_index(cluster_[c]));
    for (int i = 0; i < width; ++i) x[i] = m[i] - mean[i];
    for (int i = 0; i < dimension; ++i) {
      double* const row = P + i * width;
      for (int k = 0; k < width; ++k) {
        row[k] += shares_[c] * (other[i * width + k] + x[i] * x[k]);
      }
    }
  }
  padded::mirror_upper(P, width, dimension);
  reduced.set_tag(j, merged_tag(mixture));
}

ComponentTag MixtureReduction::merged_tag(const GaussianMixture& mixture) const {
  ComponentTag tag = mixture.tag(cluster_.front());
  if (tag.delivered <= 0.0) return tag;
  double mean = 0.0, square = 0.0;
  for (std::size_t c = 0; c < cluster_.size(); ++c) {
    const ComponentTag& other = mixture.tag(cluster_[c]);
    const double count = other.delivered + other.lost;
    const double p = other.delivered / count;
    mean += shares_[c] * p;
    square += shares_[c] * p * (other.delivered + 1.0) / (count + 1.0);
  }
  const double variance = square - mean * mean;
  const double count = mean * (1.0 - mean) / variance - 1.0;
  if (!(count > 0.0) || !std::isfinite(count)) return tag;
  tag.delivered = mean * count;
  tag.lost = (1.0 - mean) * count;
  return tag;
}

// Of the cluster that was merged last.
void MixtureReduction::record_merged(const GaussianMixture& mixture, GaussianMixture& reduced,
                                     PacketHistory& history) const {
  const int j = reduced.size() - 1;
  ComponentTag tag = reduced.tag(j);
  tag.origin = history.add();
  reduced.set_tag(j, tag);
  for (std::size_t c = 0; c < cluster_.size(); ++c) {
    history.link(mixture.tag(cluster_[c]).origin, shares_[c]);
  }
}

// Merged weights are no longer in order.
void MixtureReduction::cap(GaussianMixture& reduced, PacketHistory* history) {
  if (reduced.size() <= components_max_) return;
  prune(reduced.log_weights(), -std::numeric_limits<double>::infinity(), components_max_, cluster_);
  if (history != nullptr) record_capped(reduced, *history);
  reduced.keep(cluster_);
}

// Every component that is kept passes its weight on to the entry of those that are not, which
// thereby holds that of the whole mixture.
void MixtureReduction::record_capped(GaussianMixture& reduced, PacketHistory& history) const {
  const double log_sum = log_sum_exp(reduced.log_weights());
  if (!std::isfinite(log_sum)) return;
  const int dropped = history.add();
  double kept = 0.0;
  std::size_t next = 0;
  for (int j = 0; j < reduced.size(); ++j) {
    const double share = std::exp(reduced.log_weight(j) - log_sum);
    if (next < cluster_.size() && cluster_[next] == j) {
      kept += share;
      ++next;
    } else {
      history.link(reduced.tag(j).origin, share);
    }
  }
  for (const int j : cluster_) {
    ComponentTag tag = reduced.tag(j);
    const int before = tag.origin;
    tag.origin = history.add();
    reduced.set_tag(j, tag);
    history.link(dropped, 1.0);
    history.link(before, kept);
  }
}

void prune(std::span<const double> log_weights, double log_threshold, int count_max,
           std::vector<int>& kept) {
  kept.clear();
  if (log_weights.empty()) return;
  const auto heavier = [&](int left, int right) {
    const double a = log_weights[static_cast<std::size_t>(left)];
    const double b = log_weights[static_cast<std::size_t>(right)];
    return a > b || (a == b && left < right);
  };
  for (std::size_t i = 0; i < log_weights.size(); ++i) {
    if (log_weights[i] > log_threshold) kept.push_back(static_cast<int>(i));
  }
  if (kept.empty()) {
    const auto largest = std::max_element(log_weights.begin(), log_weights.end());
    kept.push_back(static_cast<int>(largest - log_weights.begin()));
  }
  if (kept.size() > static_cast<std::size_t>(count_max)) {
    std::nth_element(kept.begin(), kept.begin() + count_max, kept.end(), heavier);
    kept.resize(static_cast<std::size_t>(count_max));
    std::sort(kept.begin(), kept.end());
  }
}

}  // namespace holdfast
