#pragma once

#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "estimators/component_observation.h"
#include "estimators/flat_signal_update.h"
#include "estimators/gaussian_mixture.h"
#include "estimators/hybrid_bernoulli_belief.h"
#include "estimators/hybrid_bernoulli_options.h"
#include "estimators/hybrid_bernoulli_packets.h"
#include "estimators/packet_history.h"
#include "estimators/padded_matrix.h"

namespace holdfast {

/// Logarithms of what multiplies a component's weight: when no packet of the node is authentic, and
/// when one is, on top of its likelihood.
struct CorrectionRule {
  double none = 0.0;
  std::vector<double> authentic;   // per packet, by source and then arrival
  bool none_is_delivered = false;  // with none authentic the true one was replaced, not lost
};

/// Corrects p0 or p1 by the packets of one node: weights of all children first, then covariances
/// and means of those that are kept.
///
/// Component j and packet y, eqs. (44)-(49) of 000 with e = U'^-1 (y - y_pred), S = U'U, W = U'^-1
/// T:
///   log q = -(e'e + l log 2 pi) / 2 - log |U|,   mean = m + W'e,   covariance = P - W'W.
///
/// Without a prior of the signal (flat), or with one for the weights only (paper), the update of p1
/// is FlatSignalUpdate's.
///
/// U, W and the whitened packets are made once for all components that share a covariance. Child
/// (j, c) has index j (N + 1) + c: c = 0 no packet authentic, c = 1..N packet c - 1.
class MixtureCorrection {
 public:
  /// rows: of each source. Throws UsageError when a prior is needed.
  MixtureCorrection(const SystemModel& model, const HybridBernoulliOptions& options,
                    const HybridBernoulliLayout& layout, const std::vector<std::vector<int>>& rows,
                    bool is_attack);

  /// Weighs every child; the logarithm of their sum. The mixture must stay as it is until build().
  double weigh(const GaussianMixture& mixture, const PacketNode& node, const CorrectionRule& rule);
  /// Log weights of the children, which sum to exp(weigh()).
  std::span<const double> log_weights() const { return log_weights_; }
  /// Adds scale * (share of the children of packet c) to shares[c].
  void add_shares(double log_scale, std::span<double> shares) const;
  /// The children of these indices, in this order, with weights divided by exp(log_sum).
  void build(std::span<const int> children, double log_sum, GaussianMixture& corrected);
  /// Gives what build() made an entry each; children that it left out keep together the share that
  /// they have here, whatever later nodes say. The children must be ascending.
  void record(std::span<const int> children, double log_sum, GaussianMixture& corrected,
              PacketHistory& history);
  /// Components whose S could not be factorised, in the last weigh().
  int num_failures() const { return num_failures_; }

 private:
  struct Factor {
    std::size_t start = 0;  // of its numbers in the storage
    int posterior = -1;     // covariance in the corrected mixture
    bool is_valid = false;
    double log_norm = 0.0;
  };
  // What one source's packets need; offsets are behind a factor's start.
  struct Source {
    explicit Source(ComponentObservation of)
        : observation(std::move(of)), width(padded::width_of(observation.size())) {}

    ComponentObservation observation;
    int width;  // padded number of rows
    std::size_t reciprocals = 0, U = 0, W = 0, residuals = 0, factor_size = 0;
    std::vector<Factor> factors;
    std::vector<int> factor_of;  // per covariance, or per component of a nonlinear model
    std::size_t used = 0;        // of the storage
    std::vector<double>
        storage;  // y_pred of the first component, 1 / U_ii, U, W, U'^-1 (Y - y_pred)
    std::optional<FlatSignalUpdate> flat;
    std::vector<FlatSignalUpdate::Factor> flat_factors;  // beside factors
    std::vector<char> has_flat_factor;
    std::vector<double> offsets;  // per component, U'^-1 (y_pred - that of the first)
  };

  std::size_t shared_index(const Source& source, int component) const;
  void weigh_source(const SourcePackets& packets, std::size_t first, const CorrectionRule& rule);
  static Factor& add_factor(Source& source);
  void make_factor(Source& source, const SourcePackets& packets, int component);
  void make_flat_factor(Source& source, const SourcePackets& packets, int component);
  const FlatSignalUpdate::Factor& flat_factor(Source& source, int component);
  void correct_flat(Source& source, const SourcePackets& packets, int component, std::size_t column,
                    double* mean);
  void whiten_offset(Source& source, const Factor& factor, int component);
  int posterior_covariance(Source& source, int component, GaussianMixture& corrected);
  void build_updated(int component, std::size_t packet, double log_weight,
                     GaussianMixture& corrected);
  void build_kept(int component, double log_weight, GaussianMixture& corrected);
  std::pair<std::size_t, std::size_t> place_of(std::size_t packet) const;
  int position_of(std::size_t packet) const;
  int record_dropped(double share_sum, PacketHistory& history) const;
  double log_delivered(int component) const;
  double log_lost(int component) const;
  ComponentTag child_tag(int component, bool is_delivered) const;

  bool estimates_delivery_;
  bool weighs_flat_ = false;
  double flat_log_density_;
  std::vector<Source> sources_;
  const GaussianMixture* mixture_ = nullptr;
  const PacketNode* node_ = nullptr;
  bool none_is_delivered_ = false;
  std::size_t children_per_component_ = 1;
  std::vector<double> log_weights_, squares_, residual_;
  Eigen::VectorXd flat_residual_;
  std::vector<int> kept_covariances_;  // per covariance, its copy in the corrected mixture
  std::vector<double> dropped_components_, dropped_packets_;  // shares
  int num_failures_ = 0;
};

}  // namespace holdfast
