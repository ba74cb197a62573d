#include "plant/signal_attack_plant.h"

#include <cmath>

#include "tests/support/catch.h"

namespace holdfast {
namespace {

SystemModel two_state_model(double noise) {
  SystemModel model;
  model.A = (Eigen::MatrixXd(2, 2) << 0.9, 0.2, 0.0, 0.7).finished();
  model.C = (Eigen::MatrixXd(3, 2) << 1, 0, 0, 1, 1, 1).finished();
  model.G = (Eigen::MatrixXd(2, 1) << 0.5, 1.0).finished();
  model.H = (Eigen::MatrixXd(3, 1) << 0.0, 0.0, 2.0).finished();
  model.Q = noise * (Eigen::MatrixXd(2, 2) << 2.0, 0.6, 0.6, 1.0).finished();
  model.R = noise * (Eigen::MatrixXd(3, 3) << 1, 0.3, 0, 0.3, 1, 0, 0, 0, 4).finished();
  model.step_s = 0.1;
  model.state_names = {"x_1", "x_2"};
  model.measurement_names = {"y_1", "y_2", "y_3"};
  model.attack_names = {"a"};
  return model;
}

SignalAttackPlantOptions options_of(const std::string& yaml, const SystemModel& model) {
  ConfigurationDocument document = ConfigurationDocument::from_text(yaml, "test.yaml");
  SignalAttackPlantOptions options;
  ConfigurationMap root = document.root();
  options.read(root, ModeSet::single(model), "");
  document.finish();
  return options;
}

const char* const kConstantAttack =
    "{start_state: [1, -1], signal_attacks: [{channel: a, amplitude: 3, "
    "window: {first_step: 4, last_step: 6}}]}";

}  // namespace

TEST_CASE("without noise the plant is its model, and the attack acts in its window only") {
  const SystemModel model = two_state_model(0.0);
  SignalAttackPlant plant(ModeSet::single(model), options_of(kConstantAttack, model), {{0, 1}, {2}},
                          1, 0);
  Eigen::VectorXd x = (Eigen::VectorXd(2) << 1.0, -1.0).finished();
  for (int k = 1; k <= 10; ++k) {
    const Eigen::VectorXd a = Eigen::VectorXd::Constant(1, k >= 4 && k <= 6 ? 3.0 : 0.0);
    const PlantStep& step = plant.advance();
    CHECK(step.step == k);
    CHECK((step.state - x).norm() < 1e-14);
    REQUIRE(step.attack_signals.size() == 1);
    CHECK(step.attack_signals[0].name == "attack");
    CHECK(step.attack_signals[0].value == std::vector<double>{a[0]});
    REQUIRE(step.readings.size() == 2);
    CHECK(step.readings[0] == std::vector<double>{x[0], x[1]});
    CHECK(step.readings[1][0] == Approx(x[0] + x[1] + 2.0 * a[0]));
    CHECK(step.clean_readings[1][0] == Approx(x[0] + x[1]));
    x = model.A * x + model.G * a;
  }
}

TEST_CASE("a random walk starts at its offset and adds independent normal numbers") {
  const SystemModel model = two_state_model(0.0);
  const SignalAttackPlantOptions options = options_of(
      "{signal_attacks: [{channel: a, waveform: random_walk, amplitude: 0.5, offset: 2, "
      "window: {first_step: 11}}]}",
      model);
  const int num_runs = 400, num_steps = 60;
  double sum = 0.0, squares = 0.0, products = 0.0;
  for (int run = 0; run < num_runs; ++run) {
    SignalAttackPlant plant(ModeSet::single(model), options, {{0, 1, 2}}, 1,
                            static_cast<std::uint32_t>(run));
    double before = 0.0, added_before = 0.0;
    for (int k = 1; k <= num_steps; ++k) {
      const double value = plant.advance().attack_signals[0].value[0];
      if (k <= 10) REQUIRE(value == 0.0);
      if (k == 11) REQUIRE(value == 2.0);
      if (k > 11) {
        const double added = (value - before) / 0.5;
        sum += added;
        squares += added * added;
        products += added * added_before;
        added_before = added;
      }
      before = value;
    }
  }
  // 400 x 49 draws: mean, variance and correlation within 4 standard errors.
  const double n = num_runs * (num_steps - 11.0);
  CHECK(std::abs(sum / n) < 4.0 / std::sqrt(n));
  CHECK(std::abs(squares / n - 1.0) < 4.0 * std::sqrt(2.0 / n));
  CHECK(std::abs(products / n) < 4.0 / std::sqrt(n));
  // Everyone works known inputs out from the step, so none of them can walk.
  CHECK_THROWS_AS(options_of("{inputs: [{channel: u, waveform: random_walk}]}", model),
                  ConfigurationError);
}

TEST_CASE("a waveform begins with the first step of its window, in steps or in seconds") {
  const SystemModel model = two_state_model(0.0);
  for (const char* window : {"{first_step: 5}", "{from_s: 0.5}", "{first_step: 2, from_s: 0.5}"}) {
    SignalAttackPlant plant(
        ModeSet::single(model),
        options_of("{signal_attacks: [{channel: a, waveform: ramp, amplitude: 10, window: " +
                       std::string(window) + "}]}",
                   model),
        {{0, 1, 2}}, 1, 0);
    for (int k = 1; k <= 8; ++k) {
      INFO(window << " step " << k);
      CHECK(plant.advance().attack_signals[0].value[0] == Approx(k < 5 ? 0.0 : k - 5.0));
    }
  }
}

TEST_CASE("process and measurement noise have the model's covariances") {
  const double noise = 0.01;
  const SystemModel model = two_state_model(noise);
  Eigen::Matrix2d process = Eigen::Matrix2d::Zero();
  Eigen::Matrix3d measurement = Eigen::Matrix3d::Zero();
  int count = 0;
  for (std::uint32_t run = 0; run < 40; ++run) {
    SignalAttackPlant plant(ModeSet::single(model), options_of("{start_state: [1, 1]}", model),
                            {{0, 1, 2}}, 7, run);
    Eigen::VectorXd before;
    for (int k = 1; k <= 501; ++k) {
      const PlantStep& step = plant.advance();
      const Eigen::Map<const Eigen::Vector3d> y(step.readings[0].data());
      if (k > 1) {
        const Eigen::Vector2d w = step.state - model.A * before;
        const Eigen::Vector3d v = y - model.C * step.state;
        process += w * w.transpose();
        measurement += v * v.transpose();
        ++count;
      }
      before = step.state;
    }
  }
  process /= count;
  measurement /= count;
  // The variance of a sample covariance is (S_ii S_jj + S_ij^2) / count; 4 standard deviations.
  const auto check = [count](const auto& sample, const Eigen::MatrixXd& expected) {
    for (Eigen::Index i = 0; i < expected.rows(); ++i) {
      for (Eigen::Index j = 0; j < expected.cols(); ++j) {
        const double deviation =
            std::sqrt((expected(i, i) * expected(j, j) + expected(i, j) * expected(i, j)) / count);
        CHECK(std::abs(sample(i, j) - expected(i, j)) < 4.0 * deviation);
      }
    }
  };
  check(process, model.Q);
  check(measurement, model.R);
  // Negative control: half the correlation is told apart.
  CHECK(std::abs(process(0, 1) - 0.3 * noise) > 4.0 * std::sqrt(2.36 / count) * noise);
}

TEST_CASE("a random start spreads as asked, and the attack shifts no draw of the noise") {
  const SystemModel model = two_state_model(0.01);
  double sum = 0.0, squares = 0.0;
  const int num_runs = 4000;
  for (int run = 0; run < num_runs; ++run) {
    SignalAttackPlant plant(ModeSet::single(model),
                            options_of("{start_state: [5, 0], start_std: [2, 0]}", model),
                            {{0, 1, 2}}, 1, static_cast<std::uint32_t>(run));
    const PlantStep& step = plant.advance();
    CHECK(step.state[1] == 0.0);
    sum += step.state[0] - 5.0;
    squares += (step.state[0] - 5.0) * (step.state[0] - 5.0);
  }
  CHECK(std::abs(sum / num_runs) < 4.0 * 2.0 / std::sqrt(num_runs));
  CHECK(std::abs(squares / num_runs - 4.0) < 4.0 * 4.0 * std::sqrt(2.0 / num_runs));

  SignalAttackPlant attacked(ModeSet::single(model), options_of(kConstantAttack, model),
                             {{0, 1, 2}}, 1, 0);
  SignalAttackPlant quiet(ModeSet::single(model), options_of("{start_state: [1, -1]}", model),
                          {{0, 1, 2}}, 1, 0);
  for (int k = 1; k <= 4; ++k) {
    const PlantStep& a = attacked.advance();
    const PlantStep& b = quiet.advance();
    CHECK(a.state == b.state);
    CHECK(a.clean_readings == b.clean_readings);
  }
}

TEST_CASE("a signal attack on a channel that is not there is told") {
  const SystemModel model = two_state_model(0.01);
  CHECK_THROWS_WITH(options_of("{signal_attacks: [{channel: b}]}", model),
                    Catch::Contains("none of the plant's attack channels: a"));
  CHECK_THROWS_WITH(options_of("{signal_attacks: [{amplitude: 1}]}", model),
                    Catch::Contains("channel"));
  CHECK_THROWS_WITH(options_of("{start_state: [1]}", model), Catch::Contains("start_state"));
}

namespace {

// Modes that differ in A: 0.5, 0.6, 0.7; no noise, so that the state says which one moved it.
ModeSet three_modes() {
  SystemModel model;
  model.A = Eigen::MatrixXd::Constant(1, 1, 0.5);
  model.C = Eigen::MatrixXd::Ones(1, 1);
  model.G = Eigen::MatrixXd::Zero(1, 0);
  model.H = Eigen::MatrixXd::Zero(1, 0);
  model.Q = model.R = Eigen::MatrixXd::Zero(1, 1);
  model.step_s = 0.1;
  model.state_names = {"x"};
  model.measurement_names = {"y"};
  ModeSet modes;
  for (int i = 0; i < 3; ++i) {
    modes.topologies.push_back(model);
    modes.topologies.back().A(0, 0) += 0.1 * i;
    modes.topology_names.push_back(std::to_string(i));
    modes.modes.push_back({"m" + std::to_string(i), i, {}});
  }
  return modes;
}

SignalAttackPlant commanded_plant(const std::string& mode_changes) {
  ConfigurationDocument document = ConfigurationDocument::from_text(
      "{start_state: [1], mode_changes: [" + mode_changes + "]}", "test.yaml");
  SignalAttackPlantOptions options;
  ConfigurationMap root = document.root();
  options.read(root, three_modes(), "");
  document.finish();
  return SignalAttackPlant(three_modes(), options, {{0}}, 1, 0);
}

std::vector<int> modes_of(SignalAttackPlant& plant, int num_steps) {
  std::vector<int> modes;
  for (int k = 0; k < num_steps; ++k) modes.push_back(plant.advance().mode);
  return modes;
}

}  // namespace

TEST_CASE("a command holds from its step on, over what was planned for that step") {
  SignalAttackPlant plant = commanded_plant("{mode: m1, from_step: 3}, {mode: m2, from_step: 6}");
  CHECK(plant.obey({5, 0}) == CommandOutcome::kObeyed);
  CHECK(plant.obey({6, 1}) == CommandOutcome::kObeyed);
  CHECK(plant.obey({8, 2}) == CommandOutcome::kObeyed);
  CHECK(plant.obey({8, 0}) == CommandOutcome::kObeyed);  // the newest counts
  CHECK(modes_of(plant, 9) == std::vector<int>{0, 0, 1, 1, 0, 1, 1, 0, 0});
}

TEST_CASE("a command's mode moves the state from its step on") {
  SignalAttackPlant plant = commanded_plant("");
  plant.obey({2, 2});
  std::vector<double> states;
  for (int k = 0; k < 4; ++k) states.push_back(plant.advance().state[0]);
  CHECK(states[1] == Approx(0.5));
  CHECK(states[2] == Approx(0.5 * 0.7));
  CHECK(states[3] == Approx(0.5 * 0.7 * 0.7));
}

TEST_CASE("a late command holds from the next step on, and says that it was late") {
  SignalAttackPlant plant = commanded_plant("");
  modes_of(plant, 4);
  CHECK(plant.obey({4, 2}) == CommandOutcome::kLate);
  CHECK(plant.obey({-5, 1}) == CommandOutcome::kLate);
  CHECK(plant.obey({5, 2}) == CommandOutcome::kObeyed);
  CHECK(modes_of(plant, 2) == std::vector<int>{2, 2});
}

TEST_CASE("a plant refuses modes that it has not, and a flood of commands, and goes on") {
  SignalAttackPlant plant = commanded_plant("");
  CHECK(plant.obey({5, 3}) == CommandOutcome::kRefused);
  CHECK(plant.obey({5, -1}) == CommandOutcome::kRefused);
  std::size_t obeyed = 0;
  for (int i = 0; i < 10000; ++i) obeyed += plant.obey({100 + i, 1}) == CommandOutcome::kObeyed;
  CHECK(obeyed == SignalAttackPlant::kCommandsMax);
  CHECK(plant.obey({100, 2}) == CommandOutcome::kObeyed);  // takes the place of an earlier one
  const std::vector<int> modes = modes_of(plant, 101);
  CHECK(modes[98] == 0);
  CHECK(modes[99] == 2);
  CHECK(modes[100] == 1);
}

}  // namespace holdfast
