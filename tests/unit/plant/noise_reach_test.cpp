#include "plant/noise_reach.h"

#include <cmath>
#include <numbers>

#include "common/random_stream.h"
#include "plant/binary_target_plant.h"
#include "tests/support/catch.h"

namespace holdfast {
namespace {

BinaryTargetModel model_of_sensors(std::vector<std::vector<double>> positions_m) {
  BinaryTargetModel model;
  model.sensor_positions_m = std::move(positions_m);
  return model;
}

BinaryTargetModel with_one_sensor() {
  return model_of_sensors({{0.0, 0.0}});
}

BinaryTargetModel with_grid() {
  std::vector<std::vector<double>> positions;
  for (const double x : {10.0, 30.0, 50.0, 70.0}) {
    for (const double y : {10.0, 30.0, 50.0, 70.0}) positions.push_back({x, y});
  }
  return model_of_sensors(positions);
}

// What is compared with: nothing left out.
bool whole_bit(const BinaryTargetModel& model, double squared_distance, bool is_tail,
               double uniform, double angle) {
  const double normal = std::sqrt(-2.0 * std::log(uniform)) * std::cos(angle);
  const auto& glint = model.glint;
  const double noise = is_tail ? glint.mean_2 + std::sqrt(glint.variance_2) * normal
                               : glint.mean_1 + std::sqrt(glint.variance_1) * normal;
  return model.energy({std::sqrt(squared_distance), 0.0, 0.0, 0.0}, 0) + noise > model.threshold;
}

struct Tally {
  int settled = 0, wrong = 0, count = 0;

  void add(std::optional<bool> settled_bit, bool bit) {
    ++count;
    settled += settled_bit ? 1 : 0;
    wrong += settled_bit && *settled_bit != bit ? 1 : 0;
  }
};

Tally compare_at_random(const BinaryTargetModel& model, const NoiseReach& reach) {
  const RandomStream random(7, 0, "noise_reach_test");
  Tally tally;
  for (std::uint32_t i = 0; i < 200000; ++i) {
    const double squared_distance = std::pow(10.0, 8.0 * random.uniform(i, 0) - 2.0);
    const bool is_tail = random.uniform(i, 1) < 0.5;
    const double uniform = random.uniform(i, 2),
                 angle = 2.0 * std::numbers::pi * random.uniform(i, 3);
    tally.add(reach.settled_bit(squared_distance, is_tail, uniform),
              whole_bit(model, squared_distance, is_tail, uniform, angle));
  }
  return tally;
}

// Least uniform of each power of two, the noise at its utmost, and distances to either side of
// where the bit then changes.
Tally compare_at_bounds(const BinaryTargetModel& model, const NoiseReach& reach) {
  Tally tally;
  for (int halvings = 1; halvings <= 12; ++halvings) {
    const double uniform = std::ldexp(1.0, -halvings);
    for (const bool is_tail : {false, true}) {
      const double mean = is_tail ? model.glint.mean_2 : model.glint.mean_1;
      const double std_dev = std::sqrt(is_tail ? model.glint.variance_2 : model.glint.variance_1);
      for (const double angle : {0.0, std::numbers::pi}) {
        const double noise = mean + std_dev * std::sqrt(-2.0 * std::log(uniform)) * std::cos(angle);
        const double energy = model.threshold - noise;
        if (energy <= 0.0) continue;
        const double changes_at =
            std::pow(energy / model.source_power, -2.0 / model.decay_exponent);
        for (int exponent = -16; exponent < -3; ++exponent) {
          for (const double sign : {-1.0, 1.0}) {
            const double squared_distance = changes_at * (1.0 + sign * std::pow(10.0, exponent));
            tally.add(reach.settled_bit(squared_distance, is_tail, uniform),
                      whole_bit(model, squared_distance, is_tail, uniform, angle));
          }
        }
      }
    }
  }
  return tally;
}

std::vector<BinaryTargetModel> odd_models() {
  std::vector<BinaryTargetModel> models(9, with_one_sensor());
  models[1].threshold = -0.2;
  models[2].threshold = 0.0;
  models[3].source_power = 0.0;
  models[4].glint.mean_1 = 0.4;
  models[4].glint.mean_2 = -2.0;
  models[5].decay_exponent = 0.01;
  models[6].decay_exponent = 40.0;
  models[7].glint.variance_1 = 1e-20;
  models[8].threshold = 1e12;
  return models;
}

}  // namespace

TEST_CASE("a settled bit is the one that comes out of the noise") {
  for (const BinaryTargetModel& model : odd_models()) {
    const NoiseReach reach(model);
    CHECK(compare_at_random(model, reach).wrong == 0);
    CHECK(compare_at_bounds(model, reach).wrong == 0);
  }
}

TEST_CASE("a reach that is a little too short is found out") {
  const BinaryTargetModel model = with_one_sensor();
  BinaryTargetModel quieter = model;
  quieter.glint.variance_1 *= 0.99;
  quieter.glint.variance_2 *= 0.99;
  CHECK(compare_at_bounds(model, NoiseReach(quieter)).wrong > 0);
}

TEST_CASE("on the sensor, and where there is no number, nothing is claimed that is not so") {
  const NoiseReach reach(with_one_sensor());
  CHECK(reach.settled_bit(0.0, false, 0.9) == std::optional(true));
  CHECK(reach.settled_bit(1e300, false, 0.9) == std::optional(false));
  CHECK_FALSE(reach.settled_bit(std::nan(""), false, 0.9));
  CHECK_FALSE(reach.settled_bit(100.0, false, 1e-15));
}

TEST_CASE("readings are those of the whole noise, most of which is left out") {
  const BinaryTargetModel model = with_grid();
  const NoiseReach reach(model);
  BinaryTargetPlantOptions options;
  options.attack.dos.assign(16, 0.0);
  options.attack.deception.assign(16, 0.0);
  Tally tally;
  int num_different = 0;
  for (std::uint32_t run = 0; run < 20; ++run) {
    BinaryTargetPlant plant(model, options, 11, run);
    const RandomStream noise(11, run, "plant/sensor_noise");
    for (std::uint32_t k = 1; k <= 100; ++k) {
      const PlantStep& step = plant.advance();
      for (std::size_t s = 0; s < 16; ++s) {
        const bool is_tail = noise.uniform(k, 4 * s) < model.glint.tail_probability;
        const double nu = (is_tail ? 0.5 : 0.1) * noise.normal(k, 4 * s + 2);
        const bool bit = model.energy(step.state, s) + nu > model.threshold;
        num_different += bit != (step.clean_readings[s][0] == 1.0) ? 1 : 0;
        tally.add(reach.settled_bit(model.squared_distance(step.state, s), is_tail,
                                    noise.uniform(k, 4 * s + 2)),
                  bit);
      }
    }
  }
  CHECK(num_different == 0);
  CHECK(tally.wrong == 0);
  CHECK(tally.settled > tally.count / 2);
}

}  // namespace holdfast
