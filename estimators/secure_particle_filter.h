#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/models/binary_target/binary_target_model.h"
#include "common/random_stream.h"
#include "estimators/binary_likelihood.h"
#include "estimators/estimator.h"
#include "estimators/particle_kernel.h"
#include "estimators/particle_set.h"

namespace holdfast {

/// Keys of an estimator with `method: secure_particle_filter`.
struct SecureParticleFilterOptions {
  enum class Resampling { kSystematic, kMultinomial, kStratified };
  enum class Proposal { kBootstrap, kAuxiliary };
  enum class Likelihood { kExact, kTable };

  int particles = 500;
  Resampling resampling = Resampling::kSystematic;
  double resample_below = 1.0;  // fraction of M that the effective size must fall below; 1: always
  Proposal proposal = Proposal::kBootstrap;
  Likelihood likelihood = Likelihood::kExact;
  DuplicateRule duplicates = DuplicateRule::kAverage;
  // Needs sensors x particles x 8 bytes; left out in a step with over four factors per sensor.
  bool packet_posteriors = true;
  std::string kernel = "auto";  // a name of particle_kernels()

  void read(ConfigurationMap map);
};

/// Secure particle filter for binary sensors under DoS, deception and flipping attacks, Algorithm 1
/// of paper 002; with an assumed attack of all zeros, the standard filter that neglects attacks.
///
/// Each step: particles move by eq. (1), are weighted by p(Z_k | x) (BinaryLikelihood), give the
/// weighted mean and covariance, and are resampled by the new weights. A packet that did not arrive
/// has no factor; without packets the step predicts, and nothing is resampled.
///
/// Auxiliary proposal (Pitt and Shephard 1999): the old particles are first resampled by weight
/// times likelihood of their noise-free prediction, and the new ones weighted by likelihood over
/// that of their ancestor's prediction; the weights go on to the next step.
///
/// The prior at step 0 is the model's: Gaussian position, speed and heading. Draws are addressed by
/// (step, particle) in the streams `name` and `name/resampling`, so equal input gives equal bits
/// for one kernel. step() allocates nothing once packets have reached their largest number.
class SecureParticleFilter : public Estimator {
 public:
  /// Throws UsageError for an unknown kernel, an attack that does not fit the sensors, or a table
  /// that cannot be built.
  SecureParticleFilter(const BinaryTargetModel& model, const BinaryTargetModel::Attack& assumed,
                       const SecureParticleFilterOptions& options, std::uint64_t seed,
                       std::uint32_t run, std::string_view name);

  const Estimate& step(std::int64_t step, const MeasurementSet& measurements,
                       const Eigen::VectorXd& known_input) override;

  /// Particles, for tests: after step(), those that the next step starts from.
  const ParticleSet& particles() const { return particles_; }
  /// Posterior weights of the last step, before resampling.
  const double* weights() const { return weights_.data(); }
  const char* kernel_name() const { return kernel_.name; }
  /// Packets refused since construction.
  std::int64_t refused_packets() const { return refused_packets_; }

 private:
  // Under kProduct each packet is a factor; a flood of them must not take memory for its
  // posteriors.
  static constexpr std::size_t kFactorsPerSensorMax = 4;

  void draw_prior();
  void propagate(std::uint32_t step);
  void first_stage(std::uint32_t step);
  bool weigh();
  bool normalise(const double* log_likelihood);
  void estimate_moments();
  void estimate_packets(const MeasurementSet& measurements, bool is_weighted);
  bool wants_resampling() const;
  void draw_ancestors(std::uint32_t step);
  void take_ancestors();

  BinaryTargetModel model_;
  SecureParticleFilterOptions options_;
  const ParticleKernel& kernel_;
  MotionConstants motion_;
  BinaryLikelihood likelihood_;
  RandomStream draws_, resampling_draws_;

  std::size_t size_, padded_;
  ParticleSet particles_, spare_, normals_;
  AlignedArray weights_, log_likelihood_;
  AlignedArray log_prior_;    // of the weights before the likelihood, when not uniform
  AlignedArray first_stage_;  // log likelihood of the noise-free predictions
  AlignedArray q_;
  bool has_uniform_prior_ = true;
  std::vector<std::int32_t> ancestors_;
  std::vector<double> uniforms_;
  Estimate estimate_;
  std::int64_t refused_packets_ = 0;
};

}  // namespace holdfast
