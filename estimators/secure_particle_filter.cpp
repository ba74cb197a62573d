#include "estimators/secure_particle_filter.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/errors.h"
#include "estimators/resampling.h"

namespace holdfast {
namespace {

constexpr double kLogImpossible = -1e250;

const ParticleKernel& kernel_of(const std::string& name) {
  const ParticleKernel* kernel = find_particle_kernel(name);
  if (kernel != nullptr) return *kernel;
  std::string names = "auto";
  for (const ParticleKernel* known : particle_kernels()) names += std::string(", ") + known->name;
  throw UsageError("particle kernel '" + name + "' cannot run here; use one of: " + names);
}

BinaryTargetModel::Attack checked(BinaryTargetModel::Attack attack, std::size_t num_sensors) {
  for (std::vector<double>* values : {&attack.dos, &attack.deception, &attack.flip}) {
    if (!values->empty() && values->size() != num_sensors) {
      throw UsageError("assumed attack: one probability per sensor, or none, is needed");
    }
  }
  return attack;
}

std::size_t checked_size(int particles) {
  if (particles < 1) throw UsageError("particles must be at least 1");
  return static_cast<std::size_t>(particles);
}

}  // namespace

void SecureParticleFilterOptions::read(ConfigurationMap map) {
  map.read("particles", particles, {1.0, 1e6});
  map.read_choice("resampling", resampling,
                  {{"systematic", Resampling::kSystematic},
                   {"multinomial", Resampling::kMultinomial},
                   {"stratified", Resampling::kStratified}});
  map.read("resample_below", resample_below, kProbability);
  map.read_choice("proposal", proposal,
                  {{"bootstrap", Proposal::kBootstrap}, {"auxiliary", Proposal::kAuxiliary}});
  map.read_choice("likelihood", likelihood,
                  {{"exact", Likelihood::kExact}, {"table", Likelihood::kTable}});
  map.read_choice("duplicates", duplicates,
                  {{"average", DuplicateRule::kAverage},
                   {"product", DuplicateRule::kProduct},
                   {"first", DuplicateRule::kFirst},
                   {"last", DuplicateRule::kLast}});
  map.read("packet_posteriors", packet_posteriors);
  map.read("kernel", kernel);
  if (find_particle_kernel(kernel) == nullptr) {
    map.problem("kernel", "'" + kernel + "' cannot run here; auto or portable always can");
  }
}

SecureParticleFilter::SecureParticleFilter(const BinaryTargetModel& model,
                                           const BinaryTargetModel::Attack& assumed,
                                           const SecureParticleFilterOptions& options,
                                           std::uint64_t seed, std::uint32_t run,
                                           std::string_view name)
    : model_(model),
      options_(options),
      kernel_(kernel_of(options.kernel)),
      likelihood_(model, checked(assumed, model.num_sensors()), options.duplicates,
                  options.likelihood == SecureParticleFilterOptions::Likelihood::kTable, kernel_),
      draws_(seed, run, name),
      resampling_draws_(seed, run, std::string(name) + "/resampling"),
      size_(checked_size(options.particles)),
      padded_(padded_size(size_)),
      particles_(size_),
      spare_(size_),
      normals_(size_),
      weights_(size_),
      log_likelihood_(size_),
      log_prior_(size_),
      first_stage_(size_),
      ancestors_(size_),
      uniforms_(size_ + 1) {
  const BinaryTargetModel::AxisNoise noise = model.axis_noise();
  motion_ = {model.step_s, noise.position, noise.cross, noise.velocity};
  if (options.packet_posteriors) q_ = AlignedArray(model.num_sensors() * padded_);
  estimate_.mean.resize(4);
  estimate_.covariance.resize(4, 4);
  draw_prior();
}

void SecureParticleFilter::draw_prior() {
  const auto& prior = model_.prior;
  double* const normals[4] = {normals_.component[0].data(), normals_.component[1].data(),
                              normals_.component[2].data(), normals_.component[3].data()};
  kernel_.fill_normals({draws_.key(), draws_.run(), 0}, normals, padded_);
  for (std::size_t i = 0; i < padded_; ++i) {
    const double speed = prior.speed_mean_mps + prior.speed_std_mps * normals[2][i];
    const double heading = prior.heading_mean_rad + prior.heading_std_rad * normals[3][i];
    particles_.component[0][i] = prior.position_mean_m[0] + prior.position_std_m * normals[0][i];
    particles_.component[1][i] = speed * std::cos(heading);
    particles_.component[2][i] = prior.position_mean_m[1] + prior.position_std_m * normals[1][i];
    particles_.component[3][i] = speed * std::sin(heading);
  }
}

const Estimate& SecureParticleFilter::step(std::int64_t step, const MeasurementSet& measurements,
                                           const Eigen::VectorXd& /*known_input*/) {
  const auto draw_step = static_cast<std::uint32_t>(step);
  estimate_.step = step;
  estimate_.utime = measurements.utime;
  estimate_.measurement_seq = measurements.seq;
  const BinaryLikelihood::Reception reception = likelihood_.set_measurements(measurements);
  refused_packets_ += static_cast<std::int64_t>(reception.num_refused);

  const bool has_packets = reception.num_used > 0;
  const bool is_auxiliary = options_.proposal == SecureParticleFilterOptions::Proposal::kAuxiliary;
  if (has_packets && is_auxiliary) first_stage(draw_step);
  propagate(draw_step);
  const bool is_possible = !has_packets || weigh();
  if (!has_packets || !is_possible) normalise(nullptr);

  estimate_.outcome = !is_possible                ? StepOutcome::kDegenerateWeights
                      : reception.num_refused > 0 ? StepOutcome::kRefusedInput
                      : !has_packets              ? StepOutcome::kNoPackets
                                                  : StepOutcome::kOk;
  estimate_moments();
  estimate_packets(measurements, has_packets && is_possible);
  if (has_packets && is_possible && !is_auxiliary && wants_resampling()) {
    draw_ancestors(draw_step);
    take_ancestors();
    has_uniform_prior_ = true;
  }
  return estimate_;
}

void SecureParticleFilter::propagate(std::uint32_t step) {
  double* const normals[4] = {normals_.component[0].data(), normals_.component[1].data(),
                              normals_.component[2].data(), normals_.component[3].data()};
  double* const state[4] = {particles_.component[0].data(), particles_.component[1].data(),
                            particles_.component[2].data(), particles_.component[3].data()};
  kernel_.fill_normals({draws_.key(), draws_.run(), step}, normals, padded_);
  kernel_.propagate(motion_, normals, state, padded_);
}

void SecureParticleFilter::first_stage(std::uint32_t step) {
  for (int c = 0; c < 4; ++c) {
    std::copy_n(particles_.component[c].data(), padded_, spare_.component[c].data());
  }
  double* const state[4] = {spare_.component[0].data(), spare_.component[1].data(),
                            spare_.component[2].data(), spare_.component[3].data()};
  kernel_.propagate({motion_.step_s, 0.0, 0.0, 0.0}, state, state, padded_);
  likelihood_.log_likelihood(spare_, first_stage_.data(), nullptr);
  for (std::size_t i = 0; i < padded_; ++i) {
    log_likelihood_[i] = first_stage_[i] + (has_uniform_prior_ ? 0.0 : log_prior_[i]);
  }
  if (!normalise(log_likelihood_.data()) || !wants_resampling()) return;
  draw_ancestors(step);
  for (std::size_t i = 0; i < size_; ++i) {
    log_prior_[i] = -first_stage_[static_cast<std::size_t>(ancestors_[i])];
  }
  take_ancestors();
  has_uniform_prior_ = false;
}

// Weights of this step, and the prior of the next one as if nothing were resampled.
bool SecureParticleFilter::weigh() {
  const std::size_t q_size = likelihood_.num_factors() * padded_;
  const bool fits = likelihood_.num_factors() <= kFactorsPerSensorMax * model_.num_sensors();
  if (options_.packet_posteriors && fits && q_size > q_.padded()) q_ = AlignedArray(q_size);
  double* const q = options_.packet_posteriors && fits ? q_.data() : nullptr;

  const bool is_always_resampled =
      options_.resample_below >= 1.0 &&
      options_.proposal == SecureParticleFilterOptions::Proposal::kBootstrap;
  if (is_always_resampled && has_uniform_prior_ && likelihood_.is_linear()) {
    likelihood_.likelihood(particles_, weights_.data(), q);
    std::fill(weights_.data() + size_, weights_.data() + padded_, 0.0);
    const double sum = kernel_.sum(weights_.data(), padded_);
    kernel_.scale(1.0 / sum, weights_.data(), padded_);
    return true;
  }
  likelihood_.log_likelihood(particles_, log_likelihood_.data(), q);
  if (!has_uniform_prior_) {
    for (std::size_t i = 0; i < padded_; ++i) log_likelihood_[i] += log_prior_[i];
  }
  if (!normalise(log_likelihood_.data())) return false;
  log_likelihood_.swap(log_prior_);
  has_uniform_prior_ = false;
  return true;
}

// Fills weights_ from logarithms, which it shifts so that the largest is zero; false, with nothing
// changed, when no particle is possible. null: from the prior.
bool SecureParticleFilter::normalise(const double* log_likelihood) {
  if (log_likelihood == nullptr && has_uniform_prior_) {
    std::fill(weights_.data(), weights_.data() + size_, 1.0 / static_cast<double>(size_));
    return true;
  }
  double* const logs = log_likelihood == nullptr ? log_prior_.data() : log_likelihood_.data();
  const double log_max = *std::max_element(logs, logs + size_);
  if (!(log_max > kLogImpossible)) return false;
  for (std::size_t i = 0; i < padded_; ++i) logs[i] -= log_max;
  kernel_.exponential(logs, 0.0, weights_.data(), padded_);
  std::fill(weights_.data() + size_, weights_.data() + padded_, 0.0);
  kernel_.scale(1.0 / kernel_.sum(weights_.data(), padded_), weights_.data(), padded_);
  return true;
}

void SecureParticleFilter::estimate_moments() {
  const double* const state[4] = {particles_.component[0].data(), particles_.component[1].data(),
                                  particles_.component[2].data(), particles_.component[3].data()};
  Moments moments;
  kernel_.moments(state, weights_.data(), padded_, moments);
  for (int row = 0; row < 4; ++row) {
    estimate_.mean[row] = moments.mean[row];
    for (int column = 0; column < 4; ++column) {
      estimate_.covariance(row, column) = moments.covariance[row][column];
    }
  }
}

void SecureParticleFilter::estimate_packets(const MeasurementSet& measurements, bool is_weighted) {
  estimate_.packet_rx_index.clear();
  estimate_.packet_probability.clear();
  if (!options_.packet_posteriors || !is_weighted) return;
  if (likelihood_.num_factors() > kFactorsPerSensorMax * model_.num_sensors()) return;
  for (std::size_t p = 0; p < measurements.packets.size(); ++p) {
    estimate_.packet_rx_index.push_back(measurements.packets[p].rx_index);
    estimate_.packet_probability.push_back(
        likelihood_.authentic_probability(p, weights_.data(), q_.data(), padded_));
  }
}

bool SecureParticleFilter::wants_resampling() const {
  if (options_.resample_below >= 1.0) return true;
  const double effective = 1.0 / kernel_.sum_of_squares(weights_.data(), padded_);
  return effective < options_.resample_below * static_cast<double>(size_);
}

void SecureParticleFilter::draw_ancestors(std::uint32_t step) {
  using Resampling = SecureParticleFilterOptions::Resampling;
  const std::span<const double> weights(weights_.data(), size_);
  if (options_.resampling == Resampling::kSystematic) {
    systematic_ancestors(weights, resampling_draws_.uniform(step, 0), ancestors_);
    return;
  }
  for (std::size_t i = 0; i <= size_; ++i) uniforms_[i] = resampling_draws_.uniform(step, i);
  if (options_.resampling == Resampling::kStratified) {
    stratified_ancestors(weights, uniforms_, ancestors_);
  } else {
    multinomial_ancestors(weights, uniforms_, ancestors_);
  }
}

void SecureParticleFilter::take_ancestors() {
  for (int c = 0; c < 4; ++c) {
    const double* const from = particles_.component[c].data();
    double* const to = spare_.component[c].data();
    for (std::size_t i = 0; i < size_; ++i) to[i] = from[ancestors_[i]];
    std::copy_n(from + size_, padded_ - size_, to + size_);
  }
  particles_.swap(spare_);
}

}  // namespace holdfast
