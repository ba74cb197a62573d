#include "estimators/hybrid_bernoulli_estimate.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace holdfast {

HybridBernoulliOutput::HybridBernoulliOutput(const HybridBernoulliOptions& options,
                                             const HybridBernoulliLayout& layout)
    : options_(options), layout_(layout) {
  const Eigen::Index n = layout.num_states, m = layout.num_channels;
  estimate_.mean.setZero(n);
  estimate_.covariance.setZero(n, n);
  estimate_.input_mean.setZero(m);
  estimate_.input_covariance.setZero(m, m);
  estimate_.hypotheses.resize(2);
  for (HypothesisEstimate& hypothesis : estimate_.hypotheses) {
    hypothesis.mean.setZero(n);
    hypothesis.covariance.setZero(n, n);
  }
  estimate_.hypotheses[0].name = "no_attack";
  estimate_.hypotheses[1].name = "attack";
  if (options.attack_models.size() > 1) {
    estimate_.mode_probability.assign(options.attack_models.size(), 0.0);
  }
}

const Estimate& HybridBernoulliOutput::write(std::int64_t step, StepOutcome outcome,
                                             const MeasurementSet& measurements,
                                             const std::vector<double>& packet_probability,
                                             const HybridBernoulliBelief& belief) {
  estimate_.step = step;
  estimate_.utime = measurements.utime;
  estimate_.measurement_seq = measurements.seq;
  estimate_.outcome = outcome;
  estimate_.attack_probability = std::clamp(belief.attack_probability(), 0.0, 1.0);
  estimate_.packet_rx_index.clear();
  for (const Packet& packet : measurements.packets) {
    estimate_.packet_rx_index.push_back(packet.rx_index);
  }
  estimate_.packet_probability = packet_probability;
  write_state(belief);
  write_signal(belief);
  if (!estimate_.mode_probability.empty()) write_models(belief.p1);
  estimate_.input_step = step - (layout_.is_delayed || layout_.has_memory ? 1 : 0);
  return estimate_;
}

void HybridBernoulliOutput::write_state(const HybridBernoulliBelief& belief) {
  const Eigen::Index n = layout_.num_states;
  belief.p0.moments(mean_[0], covariance_[0]);
  belief.p1.moments(mean_[1], covariance_[1]);
  const double probability[2] = {std::exp(belief.log_not_r), std::exp(belief.log_r)};
  for (std::size_t i = 0; i < 2; ++i) {
    HypothesisEstimate& hypothesis = estimate_.hypotheses[i];
    hypothesis.probability = probability[i];
    hypothesis.mean = mean_[i].head(n);
    hypothesis.covariance = covariance_[i].topLeftCorner(n, n);
  }
  if (options_.state == HybridBernoulliOptions::State::kDominant) {
    const GaussianMixture& likelier = probability[1] > 0.5 ? belief.p1 : belief.p0;
    const int j = likelier.dominant();
    estimate_.mean = likelier.mean(j).head(n);
    estimate_.covariance = likelier.covariance(j).topLeftCorner(n, n);
    return;
  }
  estimate_.mean.setZero();
  for (int i = 0; i < 2; ++i) estimate_.mean += probability[i] * mean_[i].head(n);
  estimate_.covariance.setZero();
  for (int i = 0; i < 2; ++i) {
    estimate_.covariance += probability[i] * covariance_[i].topLeftCorner(n, n);
    for (Eigen::Index c = 0; c < n; ++c) {
      const double offset = mean_[i][c] - estimate_.mean[c];
      estimate_.covariance.col(c) += probability[i] * offset * (mean_[i].head(n) - estimate_.mean);
    }
  }
}

// With a memory the signal of the step before, in the heaviest component that was attacked then,
// of whichever hypothesis about now.
void HybridBernoulliOutput::write_signal(const HybridBernoulliBelief& belief) {
  const Eigen::Index m = layout_.num_channels;
  const GaussianMixture* source = &belief.p1;
  int best = belief.p1.dominant();
  Eigen::Index first = layout_.num_states;
  if (layout_.has_memory) {
    double heaviest = -std::numeric_limits<double>::infinity();
    for (const GaussianMixture* mixture : {&belief.p0, &belief.p1}) {
      const double log_scale = mixture == &belief.p0 ? belief.log_not_r : belief.log_r;
      for (int j = 0; j < mixture->size(); ++j) {
        const double log_weight = mixture->log_weight(j) + log_scale;
        if (!mixture->tag(j).was_attacked || log_weight <= heaviest) continue;
        heaviest = log_weight;
        source = mixture;
        best = j;
        first = mixture->dimension() - m;
      }
    }
  }
  estimate_.input_mean = source->mean(best).segment(first, m);
  estimate_.input_covariance = source->covariance(best).block(first, first, m, m);
}

void HybridBernoulliOutput::write_models(const GaussianMixture& p1) {
  std::fill(estimate_.mode_probability.begin(), estimate_.mode_probability.end(), 0.0);
  double sum = 0.0;
  for (int j = 0; j < p1.size(); ++j) {
    if (p1.tag(j).attack_model < 0) continue;  // of a belief that was set
    const double weight = p1.weight(j);
    sum += weight;
    estimate_.mode_probability[static_cast<std::size_t>(p1.tag(j).attack_model)] += weight;
  }
  if (sum <= 0.0) return;
  for (double& value : estimate_.mode_probability) value /= sum;
}

}  // namespace holdfast
