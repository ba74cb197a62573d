#pragma once

#include <span>
#include <vector>

#include "estimators/gaussian_mixture.h"
#include "estimators/hybrid_bernoulli_options.h"
#include "estimators/packet_history.h"

namespace holdfast {

/// Merging and capping of a Gaussian mixture (Vo and Ma 2006, Table II).
///
/// The heaviest component takes in every other of the same attack model whose
///   (m_i - m_j)' P^-1 (m_i - m_j) <= merge_below,
/// P being that of the other (kOwn) or of the heaviest one (kDominant), and becomes one Gaussian of
/// the same moments over the whole component; then the heaviest of the rest, and so on; then the
/// components_max heaviest stay and weights are normalised. Equal weights: the first one is
/// heavier. Where a covariance is singular the means of one attack model agree, and such a
/// direction counts nothing. O(J log J + J K d^2), K components left before the cap. Keeps its
/// memory.
class MixtureReduction {
 public:
  explicit MixtureReduction(const HybridBernoulliOptions& options);

  /// reduced is overwritten; it has the mixture's dimension and is another object. A history gets
  /// an entry for what is merged; components that the cap drops keep together the share that they
  /// have here.
  void reduce(const GaussianMixture& mixture, GaussianMixture& reduced,
              PacketHistory* history = nullptr);

 private:
  const double* factor(const GaussianMixture& mixture, int index);
  // Of a pair, whose covariance measures the distance.
  int measuring(int dominant, int other) const {
    return metric_ == HybridBernoulliOptions::MergeMetric::kOwn ? other : dominant;
  }
  bool is_far(const GaussianMixture& mixture, int dominant, int other) const;
  double squared_distance(const GaussianMixture& mixture, int dominant, int other);
  void gather(const GaussianMixture& mixture, std::size_t first);
  void merge(const GaussianMixture& mixture, GaussianMixture& reduced, int dimension, int width);
  ComponentTag merged_tag(const GaussianMixture& mixture) const;
  void record_merged(const GaussianMixture& mixture, GaussianMixture& reduced,
                     PacketHistory& history) const;
  void cap(GaussianMixture& reduced, PacketHistory* history);
  void record_capped(GaussianMixture& reduced, PacketHistory& history) const;

  double merge_below_;
  HybridBernoulliOptions::MergeMetric metric_;
  int components_max_;
  std::vector<int> order_;  // by falling weight
  std::vector<char> is_taken_;
  std::vector<int> cluster_;  // dominant first
  std::vector<double> factors_, difference_, shares_;
  std::vector<int> factor_of_, copy_of_;  // per covariance, -1 before it is needed
};

/// Indices, ascending, of log weights above the threshold, at most count_max of the largest; always
/// that of the largest. Equal ones: the first is larger.
void prune(std::span<const double> log_weights, double log_threshold, int count_max,
           std::vector<int>& kept);

}  // namespace holdfast
