#include "estimators/binary_likelihood.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/errors.h"
#include "common/random_stream.h"
#include "tests/unit/estimators/golden_binary_pf.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

const ParticleKernel& fastest() {
  return *particle_kernels().front();
}

ParticleSet random_particles(std::size_t size, double spread_m) {
  const RandomStream stream(11, 0, "test/particles");
  ParticleSet particles(size);
  for (std::size_t i = 0; i < size; ++i) {
    particles.component[0][i] = 40.0 + spread_m * stream.normal(1, 2 * i);
    particles.component[2][i] = 40.0 + spread_m * stream.normal(1, 2 * i + 1);
  }
  return particles;
}

// P(bit = 1 | x) by the tree of eqs. (4)-(7), written out branch by branch.
double bit_probability(const BinaryTargetModel& model, const BinaryTargetModel::Attack& attack,
                       std::size_t sensor, const BinaryTargetModel::State& state) {
  const double phi = attack.dos[sensor], varphi = attack.deception[sensor],
               alpha = attack.flip[sensor];
  const double a = attack.deception_low, b = attack.deception_high, T = model.threshold;
  const double zero = 0.0 > T ? 1.0 : 0.0;
  const double lie = T >= b ? 0.0 : T <= a ? 1.0 : (b - T) / (b - a);
  const double truth = model.glint_survival(T - model.energy(state, sensor));
  const double one = phi * zero + (1.0 - phi) * (varphi * lie + (1.0 - varphi) * truth);
  return (1.0 - alpha) * one + alpha * (1.0 - one);
}

double log_likelihood_of(BinaryLikelihood& likelihood, const MeasurementSet& set,
                         const ParticleSet& particles, std::size_t particle) {
  likelihood.set_measurements(set);
  AlignedArray out(particles.size);
  likelihood.log_likelihood(particles, out.data(), nullptr);
  return out[particle] + likelihood.log_constant();
}

MeasurementSet packets(const std::vector<std::pair<int, double>>& readings) {
  MeasurementSet set;
  for (const auto& [source, value] : readings) add_packet(set, source, value);
  return set;
}

}  // namespace

TEST_CASE("a digital bit has the probabilities of the attack tree, whatever the threshold's sign") {
  BinaryTargetModel model = grid_model(false);
  BinaryTargetModel::Attack attack = table_attack();
  attack.dos[3] = 0.4;
  attack.deception[5] = 0.7;
  attack.flip[7] = 0.95;
  ParticleSet particles = random_particles(40, 20.0);
  for (const double threshold : {0.3, 0.0, -0.3, 5.0, -5.0}) {
    model.threshold = threshold;
    for (const ParticleKernel* kernel : particle_kernels()) {
      BinaryLikelihood likelihood(model, attack, DuplicateRule::kAverage, false, *kernel);
      double worst = 0.0;
      for (int sensor = 0; sensor < 16; ++sensor) {
        for (std::size_t i = 0; i < particles.size; ++i) {
          const BinaryTargetModel::State state(particles.component[0][i], 0.0,
                                               particles.component[2][i], 0.0);
          const double one =
              bit_probability(model, attack, static_cast<std::size_t>(sensor), state);
          for (const double bit : {0.0, 1.0}) {
            const double value =
                log_likelihood_of(likelihood, packets({{sensor, bit}}), particles, i);
            worst = std::max(worst, std::abs(std::exp(value) - (bit == 1.0 ? one : 1.0 - one)));
          }
        }
      }
      INFO(kernel->name << ", T = " << threshold);
      CHECK(worst < 1e-14);  // a few roundings of numbers below one
    }
  }
}

TEST_CASE("the zero of a DoS attack exceeds a threshold only when that is below zero") {
  BinaryTargetModel model = grid_model(false);
  BinaryTargetModel::Attack attack = table_attack();
  attack.dos.assign(16, 1.0);
  attack.deception.assign(16, 0.0);
  attack.flip.assign(16, 0.0);
  const ParticleSet particles = random_particles(3, 10.0);
  for (const double threshold : {-0.3, 0.0, 0.3}) {
    model.threshold = threshold;
    BinaryLikelihood likelihood(model, attack, DuplicateRule::kAverage, false, fastest());
    const double impossible = threshold < 0.0 ? 0.0 : 1.0;
    CHECK(log_likelihood_of(likelihood, packets({{0, impossible}}), particles, 0) < -1e250);
    CHECK(log_likelihood_of(likelihood, packets({{0, 1.0 - impossible}}), particles, 0) ==
          Approx(0.0).margin(1e-15));
  }
}

TEST_CASE("what cannot be a reading is refused and changes nothing") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const ParticleSet particles = random_particles(5, 10.0);
  for (const bool has_radio : {false, true}) {
    BinaryLikelihood likelihood(grid_model(has_radio), table_attack(), DuplicateRule::kAverage,
                                false, fastest());
    const double alone = log_likelihood_of(likelihood, packets({{2, 1.0}}), particles, 4);
    MeasurementSet set =
        packets({{2, 1.0}, {16, 1.0}, {-1, 1.0}, {3, nan}, {3, -infinity}, {3, 1e200}});
    set.add(Packet{}, {});
    set.add(Packet{}, std::vector<double>{1.0, 0.0});
    if (!has_radio) add_packet(set, 3, 0.5);
    const auto reception = likelihood.set_measurements(set);
    CHECK(reception.num_used == 1);
    CHECK(reception.num_refused == set.packets.size() - 1);
    CHECK(log_likelihood_of(likelihood, set, particles, 4) == alone);
  }
}

TEST_CASE("duplicates: average, product, first and last") {
  const ParticleSet particles = random_particles(30, 15.0);
  const BinaryTargetModel model = grid_model(true);
  const auto value = [&](DuplicateRule rule, const std::vector<std::pair<int, double>>& readings,
                         std::size_t particle) {
    BinaryLikelihood likelihood(model, table_attack(), rule, false, fastest());
    return std::exp(log_likelihood_of(likelihood, packets(readings), particles, particle));
  };
  for (const std::size_t i : {0U, 7U, 29U}) {
    const double a = value(DuplicateRule::kAverage, {{4, 0.45}}, i);
    const double b = value(DuplicateRule::kAverage, {{4, 0.1}}, i);
    const double c = value(DuplicateRule::kAverage, {{4, 0.9}}, i);
    const double other = value(DuplicateRule::kAverage, {{6, 0.2}}, i);
    const std::vector<std::pair<int, double>> all = {{4, 0.45}, {6, 0.2}, {4, 0.1}, {4, 0.9}};
    CHECK(value(DuplicateRule::kAverage, all, i) ==
          Approx((a + b + c) / 3.0 * other).epsilon(1e-13));
    CHECK(value(DuplicateRule::kProduct, all, i) == Approx(a * b * c * other).epsilon(1e-13));
    CHECK(value(DuplicateRule::kFirst, all, i) == Approx(a * other).epsilon(1e-13));
    CHECK(value(DuplicateRule::kLast, all, i) == Approx(c * other).epsilon(1e-13));
    // A repeated packet says nothing new under the average rule, and counts twice in a product.
    CHECK(value(DuplicateRule::kAverage, {{4, 0.45}, {4, 0.45}}, i) == Approx(a).epsilon(1e-13));
    CHECK(value(DuplicateRule::kProduct, {{4, 0.45}, {4, 0.45}}, i) ==
          Approx(a * a).epsilon(1e-13));
  }
}

TEST_CASE("the order of packets and of sensors does not matter") {
  const ParticleSet particles = random_particles(20, 15.0);
  BinaryTargetModel model = grid_model(true), reversed = model;
  std::reverse(reversed.sensor_positions_m.begin(), reversed.sensor_positions_m.end());
  BinaryLikelihood likelihood(model, table_attack(), DuplicateRule::kAverage, false, fastest());
  BinaryLikelihood mirrored(reversed, table_attack(), DuplicateRule::kAverage, false, fastest());
  std::vector<std::pair<int, double>> readings, backwards, renamed;
  for (int s = 0; s < 16; ++s) readings.emplace_back(s, 0.05 * s - 0.1);
  readings.emplace_back(3, 0.5);
  backwards.assign(readings.rbegin(), readings.rend());
  for (const auto& [source, y] : readings) renamed.emplace_back(15 - source, y);
  for (std::size_t i = 0; i < particles.size; ++i) {
    const double value = log_likelihood_of(likelihood, packets(readings), particles, i);
    // Sums of 17 logarithms in another order.
    CHECK(log_likelihood_of(likelihood, packets(backwards), particles, i) ==
          Approx(value).epsilon(1e-13));
    CHECK(log_likelihood_of(mirrored, packets(renamed), particles, i) ==
          Approx(value).epsilon(1e-13));
  }
}

TEST_CASE("a filter that neglects attacks keeps its logarithms where every double underflows") {
  // Bit 0 from the sensor on which the particle stands, seen at 4 m: 1 - q = erfc(116) or so.
  BinaryTargetModel model = grid_model(false);
  model.glint.tail_probability = 1.0;  // one Gaussian, so that the tail has a closed form
  ParticleSet particles(1);
  particles.component[0][0] = 14.0;
  particles.component[2][0] = 10.0;
  BinaryLikelihood likelihood(model, {}, DuplicateRule::kAverage, false, fastest());
  const double h = model.energy({14.0, 0.0, 10.0, 0.0}, 0);
  const double z = (h - model.threshold) / std::sqrt(2.0 * model.glint.variance_2);
  const double series = 1.0 - 0.5 / (z * z) + 0.75 / std::pow(z, 4);
  const double wanted = -z * z + std::log(series / (2.0 * z * std::sqrt(M_PI)));
  REQUIRE(z > 50.0);
  // The next term of the series is 15 / (8 z^6) < 2e-10 of a summand near 6; z^2 dominates.
  CHECK(log_likelihood_of(likelihood, packets({{0, 0.0}}), particles, 0) ==
        Approx(wanted).epsilon(1e-12));
}

TEST_CASE("many sensors neither underflow nor change form") {
  BinaryTargetModel model = grid_model(true);
  const auto positions = model.sensor_positions_m;
  for (int copy = 1; copy < 100; ++copy) {
    model.sensor_positions_m.insert(model.sensor_positions_m.end(), positions.begin(),
                                    positions.end());
  }
  const ParticleSet particles = random_particles(8, 15.0);
  BinaryLikelihood one(grid_model(true), table_attack(), DuplicateRule::kAverage, false, fastest());
  BinaryLikelihood hundred(model, table_attack(1600), DuplicateRule::kAverage, false, fastest());
  MeasurementSet small, large;
  for (int s = 0; s < 1600; ++s) {
    const double y = 0.05 * (s % 16) - 0.1;
    if (s < 16) add_packet(small, s, y);
    add_packet(large, s, y);
  }
  for (std::size_t i = 0; i < particles.size; ++i) {
    const double value = 100.0 * log_likelihood_of(one, small, particles, i);
    // 1600 roundings of terms near 3, at random: 40 ulp of 4000, and 100 times those of the small
    // sum.
    CHECK(std::abs(log_likelihood_of(hundred, large, particles, i) - value) < 1e-10);
  }
}

TEST_CASE("the table changes no weight by more than 1e-8, and is a table") {
  const ParticleSet particles = random_particles(50000, 25.0);
  const RandomStream stream(5, 0, "test/readings");
  for (const ParticleKernel* kernel : particle_kernels()) {
    BinaryLikelihood exact(grid_model(true), table_attack(), DuplicateRule::kAverage, false,
                           *kernel);
    BinaryLikelihood table(grid_model(true), table_attack(), DuplicateRule::kAverage, true,
                           *kernel);
    AlignedArray a(particles.size), b(particles.size);
    double worst = 0.0;
    for (std::uint32_t draw = 0; draw < 3; ++draw) {
      std::vector<double> y;
      for (std::size_t s = 0; s < 16; ++s) y.push_back(0.25 + 0.4 * stream.normal(draw, s));
      exact.set_measurements(set_of(y));
      table.set_measurements(set_of(y));
      exact.log_likelihood(particles, a.data(), nullptr);
      table.log_likelihood(particles, b.data(), nullptr);
      for (std::size_t i = 0; i < particles.size; ++i) {
        worst = std::max(worst, std::abs(std::expm1(b[i] - a[i])));
      }
    }
    INFO(kernel->name << ": " << worst * 1e9 << "e-9");
    CHECK(worst < 1e-8);
    CHECK(worst > 1e-13);
  }
}

TEST_CASE("the table refines its cells for a narrow noise, and says when none would do") {
  BinaryTargetModel model = grid_model(true);
  const DetectionTable wide(make_detection_law(model));
  model.glint.variance_1 = 1e-4;
  const DetectionTable narrow(make_detection_law(model));
  CHECK(narrow.cells_per_octave() > wide.cells_per_octave());
  model.glint.variance_1 = 1e-10;
  CHECK_THROWS_AS(DetectionTable(make_detection_law(model)), UsageError);
}
