#include "estimators/particle_kernel.h"

#include <cmath>
#include <cstring>

#include "common/random_stream.h"
#include "tests/unit/estimators/golden_binary_pf.h"

using namespace holdfast;
using namespace holdfast::testing;

TEST_CASE("bulk normals are those of the random stream") {
  const RandomStream stream(2024, 17, "estimator/particles");
  const std::size_t size = 4001;
  for (const ParticleKernel* kernel : particle_kernels()) {
    ParticleSet normals(size);
    const auto arrays = pointers(normals);
    double worst = 0.0;
    for (const std::uint32_t step : {0U, 1U, 99U, 4000000000U}) {
      kernel->fill_normals({stream.key(), stream.run(), step}, arrays.data(), normals.padded());
      for (std::size_t i = 0; i < size; ++i) {
        for (std::size_t c = 0; c < 4; ++c) {
          worst = std::max(worst, std::abs(arrays[c][i] - stream.normal(step, 4 * i + c)));
        }
      }
    }
    INFO(kernel->name << ": " << worst * 1e15 << "e-15");
    // The angle is rounded once (4e-16), the radius is below 9: other mathematics, same uniforms.
    CHECK(worst < 1e-14);
    if (std::string(kernel->name) == "portable") CHECK(worst == 0.0);
  }
}

TEST_CASE("particles move as the model says") {
  BinaryTargetModel model = grid_model(true);
  model.step_s = 0.7;
  const auto noise = model.axis_noise();
  const MotionConstants motion = {model.step_s, noise.position, noise.cross, noise.velocity};
  const RandomStream stream(1, 0, "test");
  const std::size_t size = 37;
  for (const ParticleKernel* kernel : particle_kernels()) {
    ParticleSet particles(size), normals(size);
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t c = 0; c < 4; ++c) {
        particles.component[c][i] = 50.0 * stream.normal(1, 4 * i + c);
        normals.component[c][i] = stream.normal(2, 4 * i + c);
      }
    }
    ParticleSet before = ParticleSet(size);
    for (std::size_t c = 0; c < 4; ++c) {
      std::memcpy(before.component[c].data(), particles.component[c].data(), size * sizeof(double));
    }
    const auto state = pointers(particles), draws = pointers(normals);
    kernel->propagate(motion, draws.data(), state.data(), particles.padded());
    double worst = 0.0;
    for (std::size_t i = 0; i < size; ++i) {
      Eigen::Vector4d x, n;
      for (int c = 0; c < 4; ++c) {
        x[c] = before.component[c][i];
        n[c] = normals.component[c][i];
      }
      const auto wanted = model.propagate(x, n);
      for (int c = 0; c < 4; ++c)
        worst = std::max(worst, golden_error(state[static_cast<std::size_t>(c)][i], wanted[c]));
    }
    CHECK(worst < 1e-15 * 4.0);  // four roundings
  }
}

TEST_CASE("weighted mean and covariance equal the sums of Eigen") {
  const RandomStream stream(3, 0, "test");
  for (const std::size_t size :
       {std::size_t{1}, std::size_t{2}, std::size_t{7}, std::size_t{601}}) {
    ParticleSet particles(size);
    AlignedArray weights(size);
    Eigen::MatrixXd states(4, static_cast<Eigen::Index>(size));
    Eigen::VectorXd w(static_cast<Eigen::Index>(size));
    for (std::size_t i = 0; i < size; ++i) {
      w[static_cast<Eigen::Index>(i)] = stream.uniform(1, i);
      for (std::size_t c = 0; c < 4; ++c) {
        particles.component[c][i] = 30.0 + stream.normal(2, 4 * i + c);
        states(static_cast<Eigen::Index>(c), static_cast<Eigen::Index>(i)) =
            particles.component[c][i];
      }
    }
    w /= w.sum();
    for (std::size_t i = 0; i < size; ++i) weights[i] = w[static_cast<Eigen::Index>(i)];
    const Eigen::Vector4d mean = states * w;
    const Eigen::MatrixXd error = states.colwise() - mean;
    const Eigen::Matrix4d covariance = error * w.asDiagonal() * error.transpose();
    for (const ParticleKernel* kernel : particle_kernels()) {
      Moments moments;
      const auto state = pointers(particles);
      kernel->moments(state.data(), weights.data(), particles.padded(), moments);
      for (int row = 0; row < 4; ++row) {
        CHECK(golden_error(moments.mean[row], mean[row]) < 1e-13);
        for (int column = 0; column < 4; ++column) {
          CHECK(golden_error(moments.covariance[row][column], covariance(row, column)) < 1e-13);
        }
      }
    }
  }
}

TEST_CASE("exponentials of far smaller logarithms are zero, not denormal") {
  for (const ParticleKernel* kernel : particle_kernels()) {
    AlignedArray logs(8), weights(8);
    const double values[8] = {0.0, -1.0, -600.0, -800.0, -1e300, -HUGE_VAL, -30.0, -0.5};
    std::memcpy(logs.data(), values, sizeof values);
    kernel->exponential(logs.data(), 0.0, weights.data(), 8);
    for (int i = 0; i < 8; ++i) {
      const double wanted = values[i] < -700.0 ? 0.0 : std::exp(values[i]);
      CHECK(std::abs(weights[static_cast<std::size_t>(i)] - wanted) <= 1e-15 * wanted);
    }
  }
}

TEST_CASE("the portable kernel always exists and auto is the first") {
  REQUIRE_FALSE(particle_kernels().empty());
  CHECK(find_particle_kernel("portable") == particle_kernels().back());
  CHECK(find_particle_kernel("auto") == particle_kernels().front());
  CHECK(find_particle_kernel("none such") == nullptr);
  CHECK(std::string(particle_kernel_name()) == particle_kernels().front()->name);
}
