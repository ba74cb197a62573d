#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

namespace holdfast {

/// Address of a step's normals in a RandomStream: particle i, component c is normal(step, 4 i + c).
struct NormalAddress {
  std::uint64_t key = 0;
  std::uint32_t run = 0;
  std::uint32_t step = 0;
};

/// Constant velocity with white acceleration, eq. (1) of paper 002, one axis.
struct MotionConstants {
  double step_s = 1.0;
  double noise_position = 0.0, noise_cross = 0.0, noise_velocity = 0.0;  // L: l11, l21, l22
};

/// q(x) = P(h(x) + nu > T) as a function of the squared distance d2, eqs. (2), (3):
/// h = gain d2^exponent, q = sum over i of weight_i erfc((T - h - mean_i) / (sqrt(2) sigma_i)).
struct DetectionLaw {
  double gain = 0.0;        // source power times d0^lambda
  double exponent = 0.0;    // -lambda / 2
  double energy_max = 0.0;  // from here on q = 1 to the last bit
  double offset[2] = {};    // (T - mean_i) / (sqrt(2) sigma_i)
  double scale[2] = {};     // 1 / (sqrt(2) sigma_i)
  double weight[2] = {};    // (1 - beta) / 2, beta / 2
};

/// One sensor's likelihood, at_hit q(x) + at_miss (1 - q(x)), scaled so that the larger one is 1.
struct LikelihoodFactor {
  double sensor_x_m = 0.0, sensor_y_m = 0.0;
  double at_hit = 0.0, at_miss = 0.0;
  double log_at_hit = 0.0, log_at_miss = 0.0;  // right also where the numbers above underflow
};

/// q(d2) by cubics in cells of constant relative width: index by exponent and top mantissa bits.
struct DetectionTableView {
  const double* coefficients = nullptr;  // [cells x 4], constant term first
  std::int64_t first_cell = 0;           // (bits of low_m2) >> shift
  int shift = 0;                         // mantissa bits below the cell's number
  double low_m2 = 0.0, high_m2 = 0.0;    // d2 is clamped to this interval
};

/// A step's likelihood, factors in the order of the rows of q.
struct LikelihoodProblem {
  const DetectionLaw* law = nullptr;
  const DetectionTableView* table = nullptr;  // null: exact
  const LikelihoodFactor* factors = nullptr;
  std::size_t num_linear = 0;   // multiplied as at_miss + (at_hit - at_miss) q: well conditioned
  std::size_t num_log = 0;      // log(at_hit q + at_miss (1 - q)), 1 - q from its own tail
  std::size_t num_two_log = 0;  // each term in logs: one of them underflows
  bool as_log = true;           // false only without log factors: the bare product
  double* q = nullptr;          // [factors x padded] out, or null
};

/// Weighted mean and covariance of a particle set.
struct Moments {
  double mean[4] = {};
  double covariance[4][4] = {};
};

/// P(packet authentic | x) = (hit q + miss (1 - q)) / (all_hit q + all_miss (1 - q)).
struct AuthenticRatio {
  double hit = 0.0, miss = 0.0, all_hit = 0.0, all_miss = 0.0;
};

/// The loops over particles, for one instruction set. Arrays are aligned and padded
/// (particle_set.h); `padded` is their padded length. Nothing allocates; one kernel gives one bit
/// pattern, always.
struct ParticleKernel {
  const char* name;
  void (*fill_normals)(const NormalAddress& address, double* const normals[4], std::size_t padded);
  /// state <- F state + L normals.
  void (*propagate)(const MotionConstants& motion, const double* const normals[4],
                    double* const state[4], std::size_t padded);
  /// out: log likelihood per particle, or the likelihood when !as_log; both without constants.
  void (*weigh)(const LikelihoodProblem& problem, const double* x, const double* y, double* out,
                std::size_t padded);
  /// weights <- exp(log_weights - log_max).
  void (*exponential)(const double* log_weights, double log_max, double* weights,
                      std::size_t padded);
  double (*sum)(const double* values, std::size_t padded);
  double (*sum_of_squares)(const double* values, std::size_t padded);
  void (*scale)(double factor, double* values, std::size_t padded);
  /// Weights add up to one and are zero in the padding.
  void (*moments)(const double* const state[4], const double* weights, std::size_t padded,
                  Moments& moments);
  /// Sum over particles of weight times the ratio.
  double (*authentic)(const AuthenticRatio& ratio, const double* q, const double* weights,
                      std::size_t padded);
};

/// Kernels that this build has and this processor can run, fastest first; "portable" is the last.
const std::vector<const ParticleKernel*>& particle_kernels();
/// The kernel of this name, or null. "auto" is the fastest.
const ParticleKernel* find_particle_kernel(std::string_view name);
/// Name of the kernel that "auto" stands for: "avx512-libmvec", "avx2-libmvec" or "portable".
const char* particle_kernel_name();

}  // namespace holdfast
