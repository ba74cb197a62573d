#include "estimators/interacting_multiple_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "common/errors.h"

namespace holdfast {
namespace {

double log_sum(double a, double b) {
  const double larger = std::max(a, b);
  if (larger == -std::numeric_limits<double>::infinity()) return larger;
  return larger + std::log1p(std::exp(std::min(a, b) - larger));
}

double checked(double probability) {
  if (!(probability >= 0.0 && probability <= 1.0)) {
    throw UsageError("a probability must be from 0 to 1");
  }
  return probability;
}

Gaussian zeros(int size) {
  return {Eigen::VectorXd::Zero(size), Eigen::MatrixXd::Zero(size, size)};
}

}  // namespace

InteractingMultipleModel::InteractingMultipleModel(const SystemModel& model,
                                                   const InteractingMultipleModelOptions& options,
                                                   std::vector<std::vector<int>> rows)
    : log_birth_(std::log(checked(options.birth_probability))),
      log_no_birth_(std::log1p(-options.birth_probability)),
      log_survival_(std::log(checked(options.survival_probability))),
      log_death_(std::log1p(-options.survival_probability)),
      none_core_(model),
      attack_core_(model, options.feedthrough,
                   options.attack_prior.gaussian(model.num_attack_channels())),
      inbox_(std::move(rows), model.num_measurements()),
      choice_(options.vector.packet, options.vector.gate_probability, inbox_),
      none_(options.start.gaussian(model.num_states())),
      attack_(attack_core_.make_input_belief()),
      from_none_(zeros(model.num_states())),
      from_attack_(from_none_),
      mixed_(from_none_),
      log_none_(std::log1p(-checked(options.start_attack_probability))),
      log_attack_(std::log(options.start_attack_probability)) {
  attack_core_.join_input(none_, attack_);
  if (options.packets == InteractingMultipleModelOptions::Packets::kAll) {
    associations_.assign(2, PacketAssociation(options.delivery_probability, options.packet_box.low,
                                              options.packet_box.high, inbox_));
  }
  estimate_.mode_probability.resize(2);
  estimate_.hypotheses.resize(2);
  estimate_.hypotheses[0].name = "no_attack";
  estimate_.hypotheses[1].name = "attack";
}

const Estimate& InteractingMultipleModel::step(std::int64_t step,
                                               const MeasurementSet& measurements,
                                               const Eigen::VectorXd& /*known_input*/) {
  inbox_.read(measurements);
  inbox_.begin(step, measurements, estimate_);
  if (has_started_) predict();
  has_started_ = true;
  if (associations_.empty()) {
    correct_by_choice();
  } else {
    PacketInbox::list_packets(measurements, estimate_);
    correct_by_all();
  }
  publish(step);
  return estimate_;
}

void InteractingMultipleModel::predict() {
  none_core_.predict_state(none_, from_none_);
  attack_core_.predict_state(attack_, from_attack_);
  const double birth = log_none_ + log_birth_, survival = log_attack_ + log_survival_;
  const double no_birth = log_none_ + log_no_birth_, death = log_attack_ + log_death_;
  log_none_ = log_sum(no_birth, death);
  log_attack_ = log_sum(birth, survival);
  // A mode that cannot be (probability 0) goes on from its own past.
  const bool can_be_none = std::isfinite(log_none_), can_be_attack = std::isfinite(log_attack_);
  match_moments(can_be_none ? std::exp(no_birth - log_none_) : 1.0, from_none_, from_attack_,
                none_);
  match_moments(can_be_attack ? std::exp(birth - log_attack_) : 0.0, from_none_, from_attack_,
                mixed_);
  attack_core_.join_input(mixed_, attack_);
}

void InteractingMultipleModel::correct_by_choice() {
  KalmanMode modes[] = {{&none_core_, &none_}, {&attack_core_, &attack_}};
  if (choice_.correct(inbox_, modes, estimate_) == PacketChoice::Result::kCorrected) {
    reweigh(modes[0].log_density, modes[1].log_density);
  }
}

void InteractingMultipleModel::correct_by_all() {
  for (int s = 0; s < inbox_.num_sources(); ++s) {
    const std::span<const UsablePacket> packets = inbox_.packets(s);
    if (packets.empty()) continue;
    none_core_.observe(none_);
    attack_core_.observe(attack_);
    if (!associations_[0].weigh(packets, s, inbox_, none_core_) ||
        !associations_[1].weigh(packets, s, inbox_, attack_core_)) {
      estimate_.outcome = StepOutcome::kFactorisationFailed;
      continue;
    }
    associations_[0].correct(packets, none_core_, none_);
    associations_[1].correct(packets, attack_core_, attack_);
    reweigh(associations_[0].log_likelihood(), associations_[1].log_likelihood());
    for (std::size_t p = 0; p < packets.size(); ++p) {
      estimate_.packet_probability[packets[p].index] =
          std::exp(log_none_) * associations_[0].weights()[p] +
          std::exp(log_attack_) * associations_[1].weights()[p];
    }
  }
}

void InteractingMultipleModel::reweigh(double log_likelihood_none, double log_likelihood_attack) {
  log_none_ += log_likelihood_none;
  log_attack_ += log_likelihood_attack;
  const double log_total = log_sum(log_none_, log_attack_);
  log_none_ -= log_total;
  log_attack_ -= log_total;
}

void InteractingMultipleModel::publish(std::int64_t step) {
  const Eigen::Index n = none_.mean.size();
  const double none = std::exp(log_none_), attack = std::exp(log_attack_);
  match_moments(none, none_, attack_, mixed_);
  estimate_.mean = mixed_.mean;
  estimate_.covariance = mixed_.covariance;
  estimate_.attack_probability = attack;
  estimate_.mode_probability = {none, attack};
  estimate_.hypotheses[0].probability = none;
  estimate_.hypotheses[0].mean = none_.mean;
  estimate_.hypotheses[0].covariance = none_.covariance;
  estimate_.hypotheses[1].probability = attack;
  estimate_.hypotheses[1].mean = attack_.mean.head(n);
  estimate_.hypotheses[1].covariance = attack_.covariance.topLeftCorner(n, n);
  attack_core_.publish_input(attack_, step, estimate_);
}

}  // namespace holdfast
