#include "plant/binary_target_plant.h"

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/catch.h"

namespace holdfast {
namespace {

nlohmann::json golden(const std::string& name) {
  std::ifstream stream(std::string(HOLDFAST_SOURCE_DIR) + "/tests/golden/binary_pf/" + name);
  REQUIRE(stream);
  return nlohmann::json::parse(stream);
}

BinaryTargetModel paper_model() {
  BinaryTargetModel model;
  for (const double x : {10.0, 30.0, 50.0, 70.0}) {
    for (const double y : {10.0, 30.0, 50.0, 70.0}) model.sensor_positions_m.push_back({x, y});
  }
  return model;
}

BinaryTargetPlantOptions options_with(double dos, double deception) {
  BinaryTargetPlantOptions options;
  options.attack.dos.assign(16, dos);
  options.attack.deception.assign(16, deception);
  return options;
}

struct Shares {
  double dos = 0.0, deception = 0.0, altered = 0.0;
  int readings = 0;
};

Shares count_attacks(double dos, double deception, int num_runs) {
  Shares shares;
  for (int run = 0; run < num_runs; ++run) {
    BinaryTargetPlant plant(paper_model(), options_with(dos, deception), 1,
                            static_cast<std::uint32_t>(run));
    for (int k = 0; k < 20; ++k) {
      const PlantStep& step = plant.advance();
      for (std::size_t s = 0; s < 16; ++s) {
        shares.dos += step.attack_signals[0].value[s];
        shares.deception += step.attack_signals[1].value[s];
        shares.altered += step.readings[s] != step.clean_readings[s] ? 1.0 : 0.0;
        ++shares.readings;
      }
    }
  }
  return shares;
}

}  // namespace

TEST_CASE("the measurement chain equals the golden vectors") {
  const auto vectors = golden("measurement.json");
  const auto& parameters = vectors["params"];
  BinaryTargetModel model;
  model.sensor_positions_m = parameters["sensors"].get<std::vector<std::vector<double>>>();
  int num_readings = 0;
  for (const auto& step : vectors["steps"]) {
    const auto x = step["x"].get<std::vector<double>>();
    const BinaryTargetModel::State state(x.data());
    for (std::size_t s = 0; s < model.num_sensors(); ++s) {
      const double energy = model.energy(state, s);
      const double expected = step["h"][s];
      CHECK(std::abs(energy - expected) <= 1e-12 * std::max(1.0, std::abs(expected)));
      SensorAttackDraws draws;
      draws.dos_uniform = step["U"][0][s];
      draws.deception_uniform = step["U"][1][s];
      draws.deception_value = step["mu"][s];
      const double sensed = energy + step["nu"][s].get<double>(), threshold = parameters["T_delta"];
      const BinaryReading reading =
          attack_binary_sensor(sensed > threshold, threshold, parameters["phi_dos"],
                               parameters["varphi_deception"], draws);
      const double attacked = reading.is_dos         ? 0.0
                              : reading.is_deception ? draws.deception_value
                                                     : sensed;
      CHECK(std::abs(attacked - step["ybar"][s].get<double>()) <=
            1e-12 * std::max(1.0, std::abs(attacked)));
      CHECK(static_cast<int>(reading.bit) == step["theta"][s].get<int>());
      const bool is_flipped =
          step["U"][2][s].get<double>() < parameters["alpha_flip"].get<double>();
      CHECK(static_cast<int>(reading.bit != is_flipped) == step["thetabar"][s].get<int>());
      ++num_readings;
    }
  }
  CHECK(num_readings >= 64);
}

TEST_CASE("without noise the target moves on a straight line") {
  BinaryTargetPlantOptions options = options_with(0.0, 0.0);
  options.trajectory = BinaryTargetPlantOptions::Trajectory::kStraight;
  BinaryTargetPlant plant(paper_model(), options, 1, 0);
  for (int k = 1; k <= 100; ++k) {
    const PlantStep& step = plant.advance();
    CHECK(step.step == k);
    CHECK(step.state[0] == Approx(15.0 + 0.4 * k).epsilon(1e-12));
    CHECK(step.state[2] == Approx(20.0 + 0.3 * k).epsilon(1e-12));
  }
}

TEST_CASE("process noise has the model's covariance") {
  // Velocity increments of one axis are N(0, Xi t); their sample variance over n draws has standard
  // deviation sqrt(2 / n) times the variance.
  const BinaryTargetModel model = paper_model();
  double sum_velocity = 0.0, sum_cross = 0.0;
  const int num_draws = 20000;
  for (int run = 0; run < num_draws / 100; ++run) {
    BinaryTargetPlant plant(model, options_with(0.0, 0.0), 5, static_cast<std::uint32_t>(run));
    Eigen::Vector4d last(15.0, 0.4, 20.0, 0.3);
    for (int k = 0; k < 100; ++k) {
      const Eigen::Vector4d state = plant.advance().state;
      const double velocity_noise = state[1] - last[1];
      const double position_noise = state[0] - last[0] - last[1];
      sum_velocity += velocity_noise * velocity_noise;
      sum_cross += velocity_noise * position_noise;
      last = state;
    }
  }
  const double expected = model.process_noise_intensity;
  const double allowed = 4.0 * std::sqrt(2.0 / num_draws) * expected;
  CHECK(std::abs(sum_velocity / num_draws - expected) < allowed);
  CHECK(std::abs(sum_velocity / num_draws - 0.9 * expected) > allowed);
  CHECK(std::abs(sum_cross / num_draws - expected / 2.0) < allowed);
}

TEST_CASE("attacks at the sensor happen as often as they should") {
  const Shares shares = count_attacks(0.1, 0.2, 100);
  const double n = shares.readings;
  const auto allowed = [n](double p) { return 4.0 * std::sqrt(p * (1.0 - p) / n); };
  CHECK(std::abs(shares.dos / n - 0.1) < allowed(0.1));
  // DoS comes first: a sensor under DoS is not deceived.
  CHECK(std::abs(shares.deception / n - 0.9 * 0.2) < allowed(0.18));
  CHECK(std::abs(shares.deception / n - 0.2) > allowed(0.2) / 2.0);
  CHECK(shares.altered > 0.0);
}

TEST_CASE("without attacks readings are the clean ones") {
  const Shares shares = count_attacks(0.0, 0.0, 10);
  CHECK(shares.dos == 0.0);
  CHECK(shares.deception == 0.0);
  CHECK(shares.altered == 0.0);
}

TEST_CASE("an attack moves neither the trajectory nor the sensors' noise") {
  BinaryTargetPlant calm(paper_model(), options_with(0.0, 0.0), 3, 0);
  BinaryTargetPlant attacked(paper_model(), options_with(0.5, 0.5), 3, 0);
  for (int k = 0; k < 50; ++k) {
    const PlantStep& a = calm.advance();
    const PlantStep& b = attacked.advance();
    CHECK(a.state == b.state);
    CHECK(a.clean_readings == b.clean_readings);
  }
}

}  // namespace holdfast
