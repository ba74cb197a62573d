#include "estimators/multiple_model.h"

#include <algorithm>
#include <utility>

namespace holdfast {

VectorOfRows::VectorOfRows(const VectorOptions& options, std::vector<std::vector<int>> rows,
                           int num_measurements)
    : inbox_(std::move(rows), num_measurements),
      choice_(options.packet, 1.0, inbox_),
      y_(Eigen::VectorXd::Zero(num_measurements)) {
  rows_.reserve(static_cast<std::size_t>(num_measurements));
}

void VectorOfRows::take(std::int64_t step, const MeasurementSet& measurements, Estimate& estimate) {
  inbox_.read(measurements);
  inbox_.begin(step, measurements, estimate);
  choice_.choose(inbox_,
                 [](std::span<const UsablePacket> /*packets*/, const std::vector<int>& /*rows*/,
                    std::span<double> /*distances*/) { return true; });
  rows_ = choice_.rows();
  for (std::size_t i = 0; i < rows_.size(); ++i) y_[rows_[i]] = choice_.values()[i];
  std::sort(rows_.begin(), rows_.end());
}

InputStatePublisher::InputStatePublisher(const ModeSet& modes, const InputStateRule& rule)
    : num_channels_(modes.topologies.front().num_attack_channels()),
      input_variance_(rule.input_std * rule.input_std),
      // One that is improved by the next reading is not known before that.
      is_direct_(!rule.improves_input),
      innovation_(modes.topologies.front().num_measurements()) {
  for (std::size_t j = 0; j < modes.modes.size(); ++j) {
    channels_.push_back(modes.modes[j].channels);
    is_direct_ = is_direct_ && InputStateFilter::shows_all_inputs(modes.model(static_cast<int>(j)));
  }
}

bool InputStatePublisher::has_input(const InputStateFilter& filter) const {
  return num_channels_ > 0 &&
         (is_direct_ || filter.innovation().size() > 0 || filter.previous_input().size() > 0);
}

void InputStatePublisher::input_of(const InputStateFilter& filter, int mode, Eigen::VectorXd& mean,
                                   Eigen::MatrixXd& covariance) const {
  mean.setZero(num_channels_);
  covariance.setZero(num_channels_, num_channels_);
  const std::vector<int>& channels = channels_[static_cast<std::size_t>(mode)];
  const auto num_channels = static_cast<Eigen::Index>(channels.size());
  AnyVector d = filter.previous_input();
  AnyMatrix Pd = filter.previous_input_covariance();
  if (is_direct_) {
    const DecoupledMode& now = filter.current();
    d = now.V1.lazyProduct(filter.seen_input());
    const AnyMatrix VP = now.V1.lazyProduct(filter.seen_input_covariance());
    Pd = VP.lazyProduct(now.V1.transpose());
    // What the rows that arrived do not show has its prior only.
    const AnyMatrix unseen = input_variance_ * now.V2;
    Pd.noalias() += unseen.lazyProduct(now.V2.transpose());
  }
  if (d.size() != num_channels) return;
  for (Eigen::Index i = 0; i < num_channels; ++i) {
    const int row = channels[static_cast<std::size_t>(i)];
    mean[row] = d[i];
    for (Eigen::Index j = 0; j < num_channels; ++j) {
      covariance(row, channels[static_cast<std::size_t>(j)]) = Pd(i, j);
    }
  }
}

void InputStatePublisher::publish(const InputStateFilter& filter, int mode, std::int64_t step,
                                  Estimate& estimate) {
  estimate.mean = filter.mean();
  estimate.covariance = filter.covariance();
  estimate.input_step = -1;
  if (has_input(filter)) {
    estimate.input_step = is_direct_ ? step : step - 1;
    input_of(filter, mode, estimate.input_mean, estimate.input_covariance);
  }
  innovation_.clear(estimate);
  if (filter.innovation().size() == 0) return;
  const ModeTransition& transition = filter.transition();
  const AnyMatrix& S = filter.gains().S;
  if (!transition.is_determined) {
    innovation_.publish(filter.innovation(), S, estimate);
  } else if (transition.N.cols() > 0) {
    const AnyVector white = transition.N.transpose().lazyProduct(filter.innovation());
    const AnyMatrix SN = S.lazyProduct(transition.N);
    const AnyMatrix covariance = transition.N.transpose().lazyProduct(SN);
    innovation_.publish(white, covariance, estimate);
  }
}

MultipleModel::MultipleModel(const ModeSet& modes, const MultipleModelOptions& options,
                             std::vector<std::vector<int>> rows)
    : vector_(options.vector, std::move(rows), modes.topologies.front().num_measurements()),
      bank_(modes.models(), options.bank, modes.names()),
      publisher_(modes, options.bank.filter),
      output_(options.output) {
  bank_.start(options.start.gaussian(modes.topologies.front().num_states()));
  for (const PlantMode& mode : modes.modes) {
    is_attacked_.push_back(mode.channels.empty() ? 0 : 1);
    estimate_.hypotheses.push_back({mode.name, 0.0, {}, {}, 0, 0});
  }
  tells_attack_ = std::find(is_attacked_.begin(), is_attacked_.end(), 0) != is_attacked_.end();
  estimate_.mode_probability.reserve(modes.modes.size());
}

const Estimate& MultipleModel::step(std::int64_t step, const MeasurementSet& measurements,
                                    const Eigen::VectorXd& known_input) {
  vector_.take(step, measurements, estimate_);
  switch (bank_.step(vector_.rows(), vector_.values(), known_input)) {
    case ModeBank::Result::kFailed:
      estimate_.outcome = StepOutcome::kFactorisationFailed;
      break;
    case ModeBank::Result::kDegenerate:
      estimate_.outcome = StepOutcome::kDegenerateWeights;
      break;
    case ModeBank::Result::kStarted:
    case ModeBank::Result::kCorrected:
      break;
  }
  publish(step);
  return estimate_;
}

void MultipleModel::publish(std::int64_t step) {
  const int most = bank_.most_probable();
  // The first step's readings weigh no mode.
  const bool weighs_modes = bank_.filter(most).innovation().size() > 0 || has_weighed_;
  has_weighed_ = weighs_modes;
  estimate_.mode_probability.resize(weighs_modes ? is_attacked_.size() : 0);
  publisher_.publish(bank_.filter(most), most, step, estimate_);
  double attacked = 0.0;
  for (int j = 0; j < bank_.num_modes(); ++j) {
    const auto index = static_cast<std::size_t>(j);
    const double probability = bank_.probability()[index];
    if (weighs_modes) estimate_.mode_probability[index] = probability;
    attacked += is_attacked_[index] != 0 ? probability : 0.0;
    HypothesisEstimate& hypothesis = estimate_.hypotheses[index];
    hypothesis.probability = probability;
    hypothesis.mean = bank_.filter(j).mean();
    hypothesis.covariance = bank_.filter(j).covariance();
  }
  if (tells_attack_ && weighs_modes) estimate_.attack_probability = std::min(1.0, attacked);
  if (output_ == MultipleModelOptions::Output::kMixture) mix();
}

// Moments of all modes together; the innovation stays that of the most probable one.
void MultipleModel::mix() {
  estimate_.mean.setZero();
  for (const HypothesisEstimate& mode : estimate_.hypotheses) {
    estimate_.mean += mode.probability * mode.mean;
  }
  estimate_.covariance.setZero();
  for (const HypothesisEstimate& mode : estimate_.hypotheses) {
    apart_ = mode.mean - estimate_.mean;
    estimate_.covariance += mode.probability * mode.covariance;
    estimate_.covariance.noalias() += (mode.probability * apart_) * apart_.transpose();
  }
  if (estimate_.input_step < 0) return;
  estimate_.input_mean.setZero();
  estimate_.input_covariance.setZero();
  for (int j = 0; j < bank_.num_modes(); ++j) {
    const double probability = bank_.probability()[static_cast<std::size_t>(j)];
    publisher_.input_of(bank_.filter(j), j, input_, input_covariance_);
    estimate_.input_mean += probability * input_;
    estimate_.input_covariance += probability * input_covariance_;
  }
  for (int j = 0; j < bank_.num_modes(); ++j) {
    const double probability = bank_.probability()[static_cast<std::size_t>(j)];
    publisher_.input_of(bank_.filter(j), j, input_, input_covariance_);
    input_apart_ = input_ - estimate_.input_mean;
    estimate_.input_covariance.noalias() += (probability * input_apart_) * input_apart_.transpose();
  }
}

}  // namespace holdfast
