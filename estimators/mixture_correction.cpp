#include "estimators/mixture_correction.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimators/gaussian_mixture.h"
#include "estimators/padded_matrix.h"

namespace holdfast {
namespace {

constexpr double kNegligibleShare = -60.0;  // logarithm of a probability

}  // namespace

MixtureCorrection::MixtureCorrection(const SystemModel& model,
                                     const HybridBernoulliOptions& options,
                                     const HybridBernoulliLayout& layout,
                                     const std::vector<std::vector<int>>& rows, bool is_attack)
    : estimates_delivery_(options.delivery_prior.has_value()),
      flat_log_density_(options.flat_log_density) {
  using InputPrior = HybridBernoulliOptions::InputPrior;
  for (const std::vector<int>& own : rows) {
    sources_.emplace_back(
        ComponentObservation(model, own, is_attack && !layout.is_delayed, options.update));
    if (is_attack && options.input_prior != InputPrior::kGaussian) {
      sources_.back().flat.emplace(model, own, layout.is_delayed);
      weighs_flat_ = options.input_prior == InputPrior::kFlat;
    }
  }
}

double MixtureCorrection::weigh(const GaussianMixture& mixture, const PacketNode& node,
                                const CorrectionRule& rule) {
  mixture_ = &mixture;
  node_ = &node;
  none_is_delivered_ = rule.none_is_delivered;
  num_failures_ = 0;
  children_per_component_ = static_cast<std::size_t>(node.count()) + 1;
  log_weights_.assign(static_cast<std::size_t>(mixture.size()) * children_per_component_,
                      kImpossible);
  for (int j = 0; j < mixture.size(); ++j) {
    log_weights_[static_cast<std::size_t>(j) * children_per_component_] =
        mixture.log_weight(j) + rule.none +
        (rule.none_is_delivered ? log_delivered(j) : log_lost(j));
  }
  std::size_t first = 0;
  for (const SourcePackets& packets : node.sources) {
    if (packets.count > 0) weigh_source(packets, first, rule);
    first += static_cast<std::size_t>(packets.count);
  }
  return log_sum_exp(log_weights_);
}

std::size_t MixtureCorrection::shared_index(const Source& source, int component) const {
  return static_cast<std::size_t>(
      source.observation.is_linear() ? mixture_->covariance_index(component) : component);
}

void MixtureCorrection::weigh_source(const SourcePackets& packets, std::size_t first,
                                     const CorrectionRule& rule) {
  Source& source = sources_[static_cast<std::size_t>(packets.source)];
  const int rows = source.observation.size(), width = source.width;
  source.reciprocals = static_cast<std::size_t>(width);
  source.U = 2 * source.reciprocals;
  source.W = source.U + static_cast<std::size_t>(rows * width);
  source.residuals = source.W + static_cast<std::size_t>(rows * mixture_->width());
  source.factor_size = source.residuals + static_cast<std::size_t>(rows * packets.width);
  source.factors.clear();
  source.has_flat_factor.clear();
  source.used = 0;
  source.factor_of.assign(
      static_cast<std::size_t>(std::max(mixture_->num_covariances(), mixture_->size())), -1);
  source.offsets.assign(static_cast<std::size_t>(mixture_->size() * width), 0.0);
  squares_.resize(static_cast<std::size_t>(packets.width));
  for (int j = 0; j < mixture_->size(); ++j) {
    int& place = source.factor_of[shared_index(source, j)];
    const bool is_first = place < 0;
    if (is_first) {
      place = static_cast<int>(source.factors.size());
      if (weighs_flat_) {
        make_flat_factor(source, packets, j);
      } else {
        make_factor(source, packets, j);
      }
    }
    const Factor& factor = source.factors[static_cast<std::size_t>(place)];
    if (!factor.is_valid) {
      ++num_failures_;
      continue;
    }
    if (!is_first) whiten_offset(source, factor, j);
    const double* const offset = source.offsets.data() + j * width;
    const double* residuals = source.storage.data() + factor.start + source.residuals;
    std::fill(squares_.begin(), squares_.end(), 0.0);
    double* const squares = squares_.data();
    for (int i = 0; i < rows; ++i, residuals += packets.width) {
      for (int c = 0; c < packets.width; ++c) {
        const double value = residuals[c] - offset[i];
        squares[c] += value * value;
      }
    }
    const double base = mixture_->log_weight(j) + factor.log_norm + log_delivered(j);
    const double* const authentic = rule.authentic.data() + first;
    double* const children =
        log_weights_.data() + static_cast<std::size_t>(j) * children_per_component_ + 1 + first;
    for (int c = 0; c < packets.count; ++c) children[c] = base + authentic[c] - 0.5 * squares[c];
  }
}

// Numbers of an earlier step are left in place: every one that is read is written first.
MixtureCorrection::Factor& MixtureCorrection::add_factor(Source& source) {
  source.factors.emplace_back().start = source.used;
  source.used += source.factor_size;
  if (source.storage.size() < source.used) source.storage.resize(source.used);
  return source.factors.back();
}

// Whitens the packets about this component's prediction: no digits are lost to a common offset.
void MixtureCorrection::make_factor(Source& source, const SourcePackets& packets, int component) {
  Factor& made = add_factor(source);
  double* const y = source.storage.data() + made.start;
  double* const reciprocals = y + source.reciprocals;
  double* const U = y + source.U;
  double* const W = y + source.W;
  double* const residuals = y + source.residuals;
  const int rows = source.observation.size(), width = mixture_->width();
  source.observation.predict(mixture_->mean_data(component),
                             mixture_->covariance_data(mixture_->covariance_index(component)),
                             width, mixture_->dimension(), y, U, W);
  made.is_valid = padded::factorise(U, source.width, rows, reciprocals, padded::Pivots::kPositive);
  if (!made.is_valid) return;
  padded::solve_transposed(U, source.width, rows, reciprocals, W, width);
  made.log_norm = -0.5 * rows * std::log(2.0 * std::numbers::pi);
  for (int i = 0; i < rows; ++i) {
    made.log_norm += std::log(reciprocals[i]);
    const double* const values = packets.Y.data() + i * packets.width;
    for (int c = 0; c < packets.width; ++c) residuals[i * packets.width + c] = values[c] - y[i];
  }
  padded::solve_transposed(U, source.width, rows, reciprocals, residuals, packets.width);
}

void MixtureCorrection::make_flat_factor(Source& source, const SourcePackets& packets,
                                         int component) {
  Factor& made = add_factor(source);
  const FlatSignalUpdate::Factor& flat = flat_factor(source, component);
  made.is_valid = flat.is_valid;
  if (!made.is_valid) return;
  made.log_norm = flat.log_norm + flat_log_density_;
  const int rows = source.observation.size();
  double* const y = source.storage.data() + made.start;
  source.flat->predict(mixture_->mean_data(component), Eigen::Map<Eigen::VectorXd>(y, rows));
  Eigen::Map<GaussianMixture::RowMajor> residuals(y + source.residuals, rows, packets.width);
  residuals = Eigen::Map<const GaussianMixture::RowMajor>(packets.Y.data(), rows, packets.width);
  residuals.colwise() -= Eigen::Map<const Eigen::VectorXd>(y, rows);
  source.flat->project(flat, residuals);
}

// The factor of the component's covariance, made when first asked for.
const FlatSignalUpdate::Factor& MixtureCorrection::flat_factor(Source& source, int component) {
  const auto place = static_cast<std::size_t>(source.factor_of[shared_index(source, component)]);
  if (source.has_flat_factor.size() < source.factors.size()) {
    source.has_flat_factor.resize(source.factors.size(), 0);
  }
  if (source.flat_factors.size() < source.factors.size()) {
    source.flat_factors.resize(source.factors.size());
  }
  if (source.has_flat_factor[place] == 0) {
    source.has_flat_factor[place] = 1;
    source.flat->factorise(mixture_->covariance(component), source.flat_factors[place]);
  }
  return source.flat_factors[place];
}

void MixtureCorrection::correct_flat(Source& source, const SourcePackets& packets, int component,
                                     std::size_t column, double* mean) {
  const int rows = source.observation.size();
  flat_residual_.resize(rows);
  source.flat->predict(mixture_->mean_data(component), flat_residual_);
  for (int i = 0; i < rows; ++i) {
    flat_residual_[i] =
        packets.Y[static_cast<std::size_t>(i * packets.width) + column] - flat_residual_[i];
  }
  source.flat->correct(flat_factor(source, component), mixture_->mean_data(component),
                       flat_residual_, mean);
}

void MixtureCorrection::whiten_offset(Source& source, const Factor& factor, int component) {
  const double* const y = source.storage.data() + factor.start;
  double* const offset = source.offsets.data() + component * source.width;
  const int rows = source.observation.size();
  if (weighs_flat_) {
    source.flat->predict(mixture_->mean_data(component), Eigen::Map<Eigen::VectorXd>(offset, rows));
    for (int i = 0; i < rows; ++i) offset[i] -= y[i];
    Eigen::Map<GaussianMixture::RowMajor> column(offset, rows, 1);
    return source.flat->project(flat_factor(source, component), column);
  }
  source.observation.predict(mixture_->mean_data(component), offset);
  for (int i = 0; i < rows; ++i) offset[i] -= y[i];
  padded::solve_transposed(y + source.U, source.width, rows, y + source.reciprocals, offset);
}

void MixtureCorrection::add_shares(double log_scale, std::span<double> shares) const {
  for (std::size_t i = 0; i < log_weights_.size(); ++i) {
    const std::size_t child = i % children_per_component_;
    const double log_share = log_weights_[i] + log_scale;
    if (child > 0 && log_share > kNegligibleShare) shares[child - 1] += std::exp(log_share);
  }
}

void MixtureCorrection::build(std::span<const int> children, double log_sum,
                              GaussianMixture& corrected) {
  corrected.clear();
  kept_covariances_.assign(static_cast<std::size_t>(mixture_->num_covariances()), -1);
  for (const int child : children) {
    const auto index = static_cast<std::size_t>(child);
    const int component = static_cast<int>(index / children_per_component_);
    const std::size_t packet = index % children_per_component_;
    const double log_weight = log_weights_[index] - log_sum;
    if (packet == 0) {
      build_kept(component, log_weight, corrected);
    } else {
      build_updated(component, packet - 1, log_weight, corrected);
    }
  }
}

void MixtureCorrection::record(std::span<const int> children, double log_sum,
                               GaussianMixture& corrected, PacketHistory& history) {
  dropped_components_.assign(static_cast<std::size_t>(mixture_->size()), 0.0);
  dropped_packets_.assign(children_per_component_, 0.0);
  double kept = 0.0, dropped_sum = 0.0;
  std::size_t next = 0;
  for (std::size_t i = 0; i < log_weights_.size(); ++i) {
    const bool is_kept = next < children.size() && static_cast<std::size_t>(children[next]) == i;
    if (is_kept) ++next;
    const double log_share = log_weights_[i] - log_sum;
    if (!(log_share > kNegligibleShare)) continue;
    const double share = std::exp(log_share);
    if (is_kept) {
      kept += share;
      continue;
    }
    dropped_sum += share;
    dropped_components_[i / children_per_component_] += share;
    dropped_packets_[i % children_per_component_] += share;
  }
  // Not quite 1, and far from it where all weights are so small that rounding makes them one.
  const double share_sum = kept + dropped_sum;
  kept /= share_sum;
  const int dropped = dropped_sum > 0.0 ? record_dropped(share_sum, history) : -1;
  for (std::size_t i = 0; i < children.size(); ++i) {
    const auto index = static_cast<std::size_t>(children[i]);
    const std::size_t packet = index % children_per_component_;
    ComponentTag tag = corrected.tag(static_cast<int>(i));
    tag.origin = history.add();
    corrected.set_tag(static_cast<int>(i), tag);
    history.link(dropped, 1.0);
    history.link(mixture_->tag(static_cast<int>(index / children_per_component_)).origin, kept);
    if (packet > 0) history.link_packet(position_of(packet - 1), kept);
  }
}

// Every child that was kept passes its weight on to this entry, which thereby holds that of the
// whole mixture.
int MixtureCorrection::record_dropped(double share_sum, PacketHistory& history) const {
  const int dropped = history.add();
  for (std::size_t j = 0; j < dropped_components_.size(); ++j) {
    history.link(mixture_->tag(static_cast<int>(j)).origin, dropped_components_[j] / share_sum);
  }
  for (std::size_t c = 1; c < dropped_packets_.size(); ++c) {
    if (dropped_packets_[c] == 0.0) continue;
    history.link_packet(position_of(c - 1), dropped_packets_[c] / share_sum);
  }
  return dropped;
}

// Block and column of a packet of the node.
std::pair<std::size_t, std::size_t> MixtureCorrection::place_of(std::size_t packet) const {
  std::size_t block = 0;
  while (packet >= static_cast<std::size_t>(node_->sources[block].count)) {
    packet -= static_cast<std::size_t>(node_->sources[block].count);
    ++block;
  }
  return {block, packet};
}

int MixtureCorrection::position_of(std::size_t packet) const {
  const auto [block, column] = place_of(packet);
  return node_->sources[block].position[column];
}

void MixtureCorrection::build_kept(int component, double log_weight, GaussianMixture& corrected) {
  const int old = mixture_->covariance_index(component);
  int& copy = kept_covariances_[static_cast<std::size_t>(old)];
  if (copy < 0) {
    copy = corrected.add_covariance();
    std::copy_n(mixture_->covariance_data(old), mixture_->dimension() * mixture_->width(),
                corrected.covariance_data(copy));
  }
  const int made = corrected.add(log_weight, copy, child_tag(component, none_is_delivered_));
  std::copy_n(mixture_->mean_data(component), mixture_->width(), corrected.mean_data(made));
}

void MixtureCorrection::build_updated(int component, std::size_t packet, double log_weight,
                                      GaussianMixture& corrected) {
  const auto [block, column] = place_of(packet);
  const SourcePackets& packets = node_->sources[block];
  Source& source = sources_[static_cast<std::size_t>(packets.source)];
  const int covariance = posterior_covariance(source, component, corrected);
  const int made = corrected.add(log_weight, covariance, child_tag(component, true));
  double* const mean = corrected.mean_data(made);
  if (source.flat) return correct_flat(source, packets, component, column, mean);
  const auto place = static_cast<std::size_t>(source.factor_of[shared_index(source, component)]);
  const double* const numbers = source.storage.data() + source.factors[place].start;
  const int rows = source.observation.size(), width = mixture_->width();
  residual_.resize(static_cast<std::size_t>(rows));
  for (int i = 0; i < rows; ++i) {
    residual_[static_cast<std::size_t>(i)] =
        numbers[source.residuals + static_cast<std::size_t>(i * packets.width) + column] -
        source.offsets[static_cast<std::size_t>(component * source.width + i)];
  }
  std::copy_n(mixture_->mean_data(component), width, mean);
  padded::add_combination(1.0, residual_.data(), 1, rows, numbers + source.W, width, mean, width);
}

int MixtureCorrection::posterior_covariance(Source& source, int component,
                                            GaussianMixture& corrected) {
  const auto place = static_cast<std::size_t>(source.factor_of[shared_index(source, component)]);
  Factor& factor = source.factors[place];
  if (factor.posterior >= 0) return factor.posterior;
  factor.posterior = corrected.add_covariance();
  double* const P = corrected.covariance_data(factor.posterior);
  const int dimension = mixture_->dimension(), width = mixture_->width();
  if (source.flat) {
    GaussianMixture::Covariance(P, dimension, dimension, Eigen::OuterStride<>(width)) =
        flat_factor(source, component).covariance;
    return factor.posterior;
  }
  std::copy_n(mixture_->covariance_data(mixture_->covariance_index(component)), dimension * width,
              P);
  padded::subtract_gram(source.storage.data() + factor.start + source.W, source.observation.size(),
                        width, P, dimension);
  return factor.posterior;
}

double MixtureCorrection::log_delivered(int component) const {
  if (!estimates_delivery_) return 0.0;
  const ComponentTag& tag = mixture_->tag(component);
  return std::log(tag.delivered / (tag.delivered + tag.lost));
}

double MixtureCorrection::log_lost(int component) const {
  if (!estimates_delivery_) return 0.0;
  const ComponentTag& tag = mixture_->tag(component);
  return std::log(tag.lost / (tag.delivered + tag.lost));
}

ComponentTag MixtureCorrection::child_tag(int component, bool is_delivered) const {
  ComponentTag tag = mixture_->tag(component);
  if (estimates_delivery_) (is_delivered ? tag.delivered : tag.lost) += 1.0;
  return tag;
}

}  // namespace holdfast
