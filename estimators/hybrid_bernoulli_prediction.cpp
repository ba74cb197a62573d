#include "estimators/hybrid_bernoulli_prediction.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "estimators/padded_matrix.h"

namespace holdfast {

HybridBernoulliPrediction::HybridBernoulliPrediction(const SystemModel& model,
                                                     const HybridBernoulliOptions& options,
                                                     const HybridBernoulliLayout& layout)
    : layout_(layout), options_(options), motion_(model, options.update) {
  const int m = layout.num_channels;
  double probability_sum = 0.0;
  for (const AttackModel& attack : options.attack_models) probability_sum += attack.probability;
  for (std::size_t i = 0; i < options.attack_models.size(); ++i) {
    const AttackModel& attack = options.attack_models[i];
    model_probability_.push_back(attack.probability / probability_sum);
    double weight_sum = 0.0;
    for (const AttackTerm& term : attack.terms) weight_sum += term.weight;
    for (const AttackTerm& term : attack.terms) {
      Term made;
      made.attack_model = static_cast<int>(i);
      made.log_weight = std::log(term.weight / weight_sum);
      made.mean.assign(static_cast<std::size_t>(m), 0.0);
      made.covariance.assign(static_cast<std::size_t>(m * m), 0.0);
      for (std::size_t c = 0; c < attack.channels.size(); ++c) {
        const auto row = static_cast<Eigen::Index>(c);
        made.mean[static_cast<std::size_t>(attack.channels[c])] = term.mean[row];
        for (std::size_t d = 0; d < attack.channels.size(); ++d) {
          made.covariance[static_cast<std::size_t>(attack.channels[c] * m + attack.channels[d])] =
              term.covariance(row, static_cast<Eigen::Index>(d));
        }
      }
      terms_.push_back(std::move(made));
    }
  }
  const int size = layout.num_states + m, width = padded::width_of(size);
  mean_.resize(static_cast<std::size_t>(width));
  covariance_.resize(static_cast<std::size_t>(size * width));
  joint_mean_ = mean_;
  joint_covariance_ = covariance_;
}

void HybridBernoulliPrediction::predict(const HybridBernoulliBelief& belief,
                                        HybridBernoulliBelief& predicted) {
  predicted.p0.clear();
  predicted.p1.clear();
  predict_odds(belief, predicted);
  move_mixture(belief.p0, false, predicted.p0, predicted.p1);
  move_mixture(belief.p1, true, predicted.p0, predicted.p1);
}

void HybridBernoulliPrediction::predict_odds(const HybridBernoulliBelief& belief,
                                             HybridBernoulliBelief& predicted) {
  const double log_from[2] = {belief.log_not_r, belief.log_r};
  const double stay[2] = {options_.birth_probability, options_.survival_probability};
  for (int i = 0; i < 2; ++i) {
    log_to_[i][0] = log_from[i] + std::log1p(-stay[i]);
    log_to_[i][1] = log_from[i] + std::log(stay[i]);
  }
  double* const log_sums[2] = {&predicted.log_not_r, &predicted.log_r};
  for (int j = 0; j < 2; ++j) {
    *log_sums[j] = log_sum_exp(std::array<double, 2>{log_to_[0][j], log_to_[1][j]});
    // A hypothesis of probability zero keeps a density: that of the parents that exist.
    const bool is_impossible = !std::isfinite(*log_sums[j]);
    for (int i = 0; i < 2; ++i) {
      log_to_[i][j] = is_impossible ? log_from[i] : log_to_[i][j] - *log_sums[j];
    }
  }
}

void HybridBernoulliPrediction::move_mixture(const GaussianMixture& parent, bool is_attacked,
                                             GaussianMixture& p0, GaussianMixture& p1) {
  const bool acts = is_attacked && !layout_.is_delayed;
  const Signal signal = !acts ? Signal::kNone : layout_.has_memory ? Signal::kKept : Signal::kMoves;
  const int dimension = motion_.dimension(signal), own_width = padded::width_of(dimension);
  const bool is_linear = motion_.is_linear();
  const auto slots = static_cast<std::size_t>(is_linear ? parent.num_covariances() : parent.size());
  in_p0_.assign(slots, -1);
  in_p1_.assign(slots * terms_.size(), -1);
  for (int j = 0; j < parent.size(); ++j) {
    if (!std::isfinite(parent.log_weight(j) + log_to_[is_attacked][0]) &&
        !std::isfinite(parent.log_weight(j) + log_to_[is_attacked][1])) {
      continue;
    }
    const auto slot = static_cast<std::size_t>(is_linear ? parent.covariance_index(j) : j);
    const bool is_new = in_p0_[slot] < 0;
    motion_.move(parent.mean_data(j),
                 is_new ? parent.covariance_data(parent.covariance_index(j)) : nullptr,
                 parent.width(), signal, mean_.data(), covariance_.data());
    if (is_new) {
      in_p0_[slot] = p0.add_covariance();
      double* const P = p0.covariance_data(in_p0_[slot]);
      for (int i = 0; i < dimension; ++i) {
        std::copy_n(covariance_.data() + i * own_width, dimension, P + i * p0.width());
      }
    }
    ComponentTag tag = parent.tag(j);
    tag.attack_model = -1;
    tag.was_attacked = is_attacked && layout_.has_memory;
    tag.delivered *= options_.delivery_memory;
    tag.lost *= options_.delivery_memory;
    const int moved = p0.add(parent.log_weight(j) + log_to_[is_attacked][0], in_p0_[slot], tag);
    std::copy_n(mean_.data(), dimension, p0.mean_data(moved));
    add_terms(parent, j, is_attacked, moved, slot, p0, p1);
  }
}

void HybridBernoulliPrediction::add_terms(const GaussianMixture& parent, int component,
                                          bool is_attacked, int moved, std::size_t slot,
                                          GaussianMixture& p0, GaussianMixture& p1) {
  ComponentTag tag = p0.tag(moved);
  for (std::size_t h = 0; h < terms_.size(); ++h) {
    tag.attack_model = terms_[h].attack_model;
    const double log_weight =
        parent.log_weight(component) + log_to_[is_attacked][1] + terms_[h].log_weight +
        log_model_probability(parent.tag(component).attack_model, tag.attack_model);
    if (!std::isfinite(log_weight)) continue;
    int& shared = in_p1_[slot * terms_.size() + h];
    if (layout_.is_delayed) {
      drive(parent, component, h, log_weight, tag, shared, p1);
    } else {
      join(p0.mean_data(moved), p0.covariance_data(p0.covariance_index(moved)), p0.width(), h,
           log_weight, tag, shared, p1);
    }
  }
}

void HybridBernoulliPrediction::join_independently(const GaussianMixture& p0, GaussianMixture& p1) {
  p1.clear();
  for (int j = 0; j < p0.size(); ++j) {
    ComponentTag tag = p0.tag(j);
    for (std::size_t h = 0; h < terms_.size(); ++h) {
      tag.attack_model = terms_[h].attack_model;
      const double log_weight =
          p0.log_weight(j) + terms_[h].log_weight + log_model_probability(-1, tag.attack_model);
      int own = -1;
      join(p0.mean_data(j), p0.covariance_data(p0.covariance_index(j)), p0.width(), h, log_weight,
           tag, own, p1);
    }
  }
}

// [x; memory] and a signal that is independent of it: [x; a; memory].
void HybridBernoulliPrediction::join(const double* mean, const double* covariance, int width,
                                     std::size_t term, double log_weight, const ComponentTag& tag,
                                     int& shared, GaussianMixture& p1) {
  const int n = layout_.num_states, m = layout_.num_channels;
  const int rest = layout_.dimension0() - n;
  const Term& own = terms_[term];
  if (shared < 0) {
    shared = p1.add_covariance();
    double* const P = p1.covariance_data(shared);
    for (int i = 0; i < n + rest; ++i) {
      double* const row = P + (i < n ? i : i + m) * p1.width();
      std::copy_n(covariance + i * width, n, row);
      std::copy_n(covariance + i * width + n, rest, row + n + m);
    }
    for (int i = 0; i < m; ++i) {
      std::copy_n(own.covariance.data() + i * m, m, P + (n + i) * p1.width() + n);
    }
  }
  double* const joined = p1.mean_data(p1.add(log_weight, shared, tag));
  std::copy_n(mean, n, joined);
  std::copy_n(own.mean.data(), m, joined + n);
  std::copy_n(mean + n, rest, joined + n + m);
}

// The signal of the step that ends, which the state shows only now: [f(x, a); a].
void HybridBernoulliPrediction::drive(const GaussianMixture& parent, int component,
                                      std::size_t term, double log_weight, const ComponentTag& tag,
                                      int& shared, GaussianMixture& p1) {
  const int n = layout_.num_states, m = layout_.num_channels;
  const int size = n + m, width = padded::width_of(size);
  const Term& own = terms_[term];
  std::copy_n(parent.mean_data(component), n, joint_mean_.data());
  std::copy_n(own.mean.data(), m, joint_mean_.data() + n);
  const bool is_new = shared < 0;
  if (is_new) {
    std::fill(joint_covariance_.begin(), joint_covariance_.end(), 0.0);
    const double* const P = parent.covariance_data(parent.covariance_index(component));
    for (int i = 0; i < n; ++i) {
      std::copy_n(P + i * parent.width(), n, joint_covariance_.data() + i * width);
    }
    for (int i = 0; i < m; ++i) {
      std::copy_n(own.covariance.data() + i * m, m, joint_covariance_.data() + (n + i) * width + n);
    }
    shared = p1.add_covariance();
  }
  motion_.move(joint_mean_.data(), is_new ? joint_covariance_.data() : nullptr, width,
               Signal::kKept, mean_.data(), covariance_.data());
  const int driven = p1.add(log_weight, shared, tag);
  std::copy_n(mean_.data(), size, p1.mean_data(driven));
  if (is_new) std::copy_n(covariance_.data(), size * width, p1.covariance_data(shared));
}

double HybridBernoulliPrediction::log_model_probability(int before, int after) const {
  const double anew = model_probability_[static_cast<std::size_t>(after)];
  const double persistence = options_.attack_model_persistence;
  if (before < 0) return std::log(anew);
  return std::log((1.0 - persistence) * anew + (before == after ? persistence : 0.0));
}

}  // namespace holdfast
