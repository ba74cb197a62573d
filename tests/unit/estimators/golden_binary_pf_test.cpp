// Every vector of tests/golden/binary_pf that concerns the filter, on every kernel of this machine.

#include <array>
#include <cmath>

#include "estimators/binary_likelihood.h"
#include "estimators/resampling.h"
#include "tests/unit/estimators/golden_binary_pf.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

// The golden files hold 60-digit results. In the one case whose noise variance is 1e-8 the argument
// of erfc multiplies the rounding of h by 7e3; the reference in doubles loses 1.6e-13 there.
double tolerance_of(const nlohmann::json& params) {
  return params.at("Sigma1").get<double>() <= 1e-8 ? 1e-11 : 1e-12;
}

struct Worst {
  double log = 0.0, weight = 0.0;
};

std::vector<double> log_likelihoods(BinaryLikelihood& likelihood, const MeasurementSet& set,
                                    const ParticleSet& particles) {
  REQUIRE(likelihood.set_measurements(set).num_refused == 0);
  AlignedArray out(particles.size);
  likelihood.log_likelihood(particles, out.data(), nullptr);
  std::vector<double> values(particles.size);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = out[i] + likelihood.log_constant();
  return values;
}

// Weights from logarithms without the constant, as the filter forms them.
double weight_error(BinaryLikelihood& likelihood, const ParticleSet& particles,
                    const std::vector<double>& wanted) {
  AlignedArray logs(particles.size);
  likelihood.log_likelihood(particles, logs.data(), nullptr);
  double log_max = -HUGE_VAL, sum = 0.0, worst = 0.0;
  for (std::size_t i = 0; i < particles.size; ++i) log_max = std::max(log_max, logs[i]);
  for (std::size_t i = 0; i < particles.size; ++i) sum += std::exp(logs[i] - log_max);
  for (std::size_t i = 0; i < particles.size; ++i) {
    worst = std::max(worst, std::abs(std::exp(logs[i] - log_max) / sum - wanted[i]));
  }
  return worst;
}

Worst check_case(const nlohmann::json& entry, const ParticleSet& particles,
                 const ParticleKernel& kernel) {
  const auto& params = entry.at("params");
  BinaryLikelihood likelihood(model_of(params), attack_of(params), DuplicateRule::kAverage, false,
                              kernel);
  const auto y = entry.at("y").get<std::vector<double>>();
  Worst worst;
  const auto sums = log_likelihoods(likelihood, set_of(y), particles);
  for (std::size_t i = 0; i < sums.size(); ++i) {
    worst.log = std::max(worst.log, golden_error(sums[i], entry.at("loglik")[i]));
  }
  worst.weight = weight_error(likelihood, particles, entry.at("weights"));
  if (!entry.contains("loglik_sensor")) return worst;
  for (std::size_t s = 0; s < y.size(); ++s) {
    MeasurementSet one;
    add_packet(one, static_cast<int>(s), y[s]);
    const auto values = log_likelihoods(likelihood, one, particles);
    for (std::size_t i = 0; i < values.size(); ++i) {
      worst.log = std::max(worst.log, golden_error(values[i], entry.at("loglik_sensor")[i][s]));
    }
  }
  return worst;
}

}  // namespace

TEST_CASE("log-likelihoods and weights equal the 60-digit values") {
  const auto file = golden("loglik.json");
  const ParticleSet particles = particles_of(file.at("particles"));
  REQUIRE(file.at("cases").size() == 23);
  for (const ParticleKernel* kernel : particle_kernels()) {
    for (const auto& entry : file.at("cases")) {
      INFO(kernel->name << ": " << entry.at("name").get<std::string>());
      const Worst worst = check_case(entry, particles, *kernel);
      CHECK(worst.log < tolerance_of(entry.at("params")));
      CHECK(worst.weight < tolerance_of(entry.at("params")));
    }
    for (const auto& entry : file.at("full16")) {
      INFO(kernel->name << ": " << entry.at("name").get<std::string>());
      const Worst worst = check_case(entry, particles_of(entry.at("particles")), *kernel);
      CHECK(worst.log < 1e-12);
      CHECK(worst.weight < 1e-12);
    }
  }
}

TEST_CASE("a threshold that is off by 1e-9 fails the golden values") {
  auto file = golden("loglik.json");
  auto& entry = file.at("cases")[0];
  entry.at("params").at("T_delta") = 0.3 + 1e-9;
  const Worst worst =
      check_case(entry, particles_of(file.at("particles")), *particle_kernels().front());
  CHECK(worst.log > 1e-12);
}

TEST_CASE("distribution and survival of the glint noise") {
  const BinaryTargetModel model;  // Table I
  const auto file = golden("loglik.json");
  const auto& rows = file.at("scalar").at("glint_cdf");
  REQUIRE(rows.size() == 14);
  for (const auto& row : rows) {
    const double u = row[0], distribution = row[1], survival = row[2];
    // erfc of this library: 1 ulp, times 2 z^2 for the rounding of its argument (u = 10: 400 ulp).
    CHECK(std::abs(model.glint_distribution(u) - distribution) < 1e-13 * distribution);
    CHECK(std::abs(model.glint_survival(u) - survival) < 1e-13 * survival);
  }
}

TEST_CASE("eight steps of Algorithm 1 with given randomness") {
  const auto file = golden("pf_chain.json");
  const auto& params = file.at("params");
  BinaryTargetModel model = model_of(params);
  model.process_noise_intensity = file.at("Xi");
  model.step_s = file.at("t");
  const auto noise = model.axis_noise();
  const MotionConstants motion = {model.step_s, noise.position, noise.cross, noise.velocity};
  const double kTolerance = 1e-12;
  for (const ParticleKernel* kernel : particle_kernels()) {
    INFO(kernel->name);
    BinaryLikelihood likelihood(model, attack_of(params), DuplicateRule::kAverage, false, *kernel);
    ParticleSet particles = particles_of(file.at("particles_init"));
    const std::size_t size = particles.size, padded = particles.padded();
    AlignedArray weights(size), logs(size);
    REQUIRE(file.at("steps").size() == 8);
    for (const auto& step : file.at("steps")) {
      ParticleSet normals = particles_of(step.at("normals"));
      const auto noise_arrays = pointers(normals), state = pointers(particles);
      kernel->propagate(motion, noise_arrays.data(), state.data(), padded);
      likelihood.set_measurements(set_of(step.at("y")));
      REQUIRE(likelihood.is_linear());
      likelihood.log_likelihood(particles, logs.data(), nullptr);
      likelihood.likelihood(particles, weights.data(), nullptr);
      for (std::size_t i = size; i < padded; ++i) weights[i] = 0.0;
      kernel->scale(1.0 / kernel->sum(weights.data(), padded), weights.data(), padded);
      Moments moments;
      kernel->moments(state.data(), weights.data(), padded, moments);
      std::vector<std::int32_t> ancestors(size);
      systematic_ancestors({weights.data(), size}, step.at("u"), ancestors);

      double worst = 0.0;
      for (std::size_t i = 0; i < size; ++i) {
        for (std::size_t c = 0; c < 4; ++c) {
          worst = std::max(worst, golden_error(state[c][i], step.at("particles_pred")[i][c]));
        }
        worst = std::max(worst,
                         golden_error(logs[i] + likelihood.log_constant(), step.at("loglik")[i]));
        worst = std::max(worst, golden_error(weights[i], step.at("weights")[i]));
      }
      for (std::size_t row = 0; row < 4; ++row) {
        worst = std::max(worst, golden_error(moments.mean[row], step.at("estimate")[row]));
        for (std::size_t column = 0; column < 4; ++column) {
          worst = std::max(worst, golden_error(moments.covariance[row][column],
                                               step.at("covariance")[row][column]));
        }
      }
      CHECK(worst < kTolerance);
      CHECK(ancestors == step.at("ancestors").get<std::vector<std::int32_t>>());

      ParticleSet next(size);
      for (std::size_t c = 0; c < 4; ++c) {
        for (std::size_t i = 0; i < size; ++i) {
          next.component[c][i] = state[c][static_cast<std::size_t>(ancestors[i])];
        }
      }
      particles.swap(next);
    }
  }
}
