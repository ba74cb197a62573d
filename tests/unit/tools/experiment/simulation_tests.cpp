#include "tools/simulation.h"

#include <cmath>

#include "tests/support/catch.h"
#include "tests/support/texts.h"
#include "tests/unit/tools/experiment/scenario_texts.h"

namespace holdfast {
namespace {

Experiment small(std::vector<std::string> overrides = {}) {
  overrides.insert(overrides.begin(),
                   {"steps=15", "estimators.secure.particles=100",
                    "estimators.neglect.particles=100", "estimators.uncorrupted.particles=100"});
  return load_experiment(testing::scenario("binary_tracking"), overrides);
}

}  // namespace

TEST_CASE("without attacks a clean and a received measurement set are the same") {
  const Experiment experiment =
      small({"attacks=[]", "plant.attack.dos=0", "plant.attack.deception=0"});
  Simulation simulation(experiment, 3);
  while (simulation.advance()) {
    CHECK(simulation.estimates()[1]->mean ==
          simulation.estimates()[2]->mean);  // neglect, uncorrupted
    CHECK(simulation.attack_records().empty());
  }
}

TEST_CASE("a scenario without a bus has no attacker") {
  const Experiment bare = small({"network.sensor_bus=none", "network.monitor_bus=none"});
  const Experiment calm = small({"attacks=[]"});
  Simulation a(bare, 0), b(calm, 0);
  while (a.advance() && b.advance()) CHECK(a.measurements().values == b.measurements().values);
}

TEST_CASE("a driver's own clock closes the same sets in a campaign as ticks do") {
  const Experiment by_tick = small(), by_clock = small({"network.close_step=clock"});
  Simulation a(by_tick, 0), b(by_clock, 0);
  while (a.advance() && b.advance()) {
    CHECK(a.measurements().packets.size() == 16);
    CHECK(a.measurements().values == b.measurements().values);
    CHECK(a.measurements().step == b.measurements().step);
  }
}

TEST_CASE("a dropped frame is a missing packet, not a zero") {
  const Experiment experiment =
      small({"attacks=[{name: drop, match: {messages: [Sensor01]}, action: drop}]"});
  Simulation simulation(experiment, 0);
  while (simulation.advance()) {
    CHECK(simulation.measurements().packets.size() == 15);
    for (const Packet& packet : simulation.measurements().packets) CHECK(packet.source != 0);
  }
}

TEST_CASE("a breaker's command acts as the same change of mode in the plan would") {
  const std::vector<std::string> common = {"steps=60"};
  const auto run = [&](std::vector<std::string> overrides) {
    overrides.insert(overrides.end(), common.begin(), common.end());
    const Experiment experiment = load_experiment(testing::scenario("three_area"), overrides);
    Simulation simulation(experiment, 4);
    std::vector<int> modes;
    std::vector<Eigen::VectorXd> means;
    while (simulation.advance()) {
      modes.push_back(simulation.truth().mode);
      means.push_back(simulation.estimates().front()->mean);
    }
    return std::pair(modes, means);
  };
  const std::string planned =
      "plant.mode_changes=[{mode: '010', from_step: 1}, {mode: '000', from_step: 31}]";
  const auto by_plan = run({planned, "attacks=[]"});
  CHECK(by_plan.first[29] == 1);
  CHECK(by_plan.first[30] == 4);
  CHECK(run({"attacks.0.window.first_step=11", "attacks.0.window.last_step=11",
             "attacks.0.lead_steps=20"}) == by_plan);
  // The operator's command, with and without a bus; and one that the attacker makes come late.
  const std::string order = "network.commands=[{after_step: 11, mode: '000', lead_steps: 20}]";
  CHECK(run({"attacks=[]", order}) == by_plan);
  CHECK(run({"attacks=[]", order, "network.sensor_bus=none", "network.monitor_bus=none"}) ==
        by_plan);
  const std::string delay =
      "attacks=[{name: delay, match: {messages: [BreakerCommand]}, action: add, signal: STEP, "
      "value: {value: 7}}]";
  const auto delayed = run({delay, order});
  CHECK(delayed.first[36] == 1);
  CHECK(delayed.first[37] == 4);
}

TEST_CASE("what a scenario says about commands is checked against the plant") {
  const auto says = [](const std::string& entry, const std::string& text) {
    testing::check_mentions(testing::problems_of("three_area", {entry}), text);
  };
  says("network.commands=[{after_step: 3, mode: '011'}]", "none of the plant's modes: 111, 010");
  says("network.commands=[{mode: '111'}]", "after_step: missing");
  // What the step signal cannot hold would wrap, and act at another step.
  const auto narrow_problems = [](const std::string& override) {
    std::string text =
        load_experiment(testing::scenario("three_area"), {"steps=60", "attacks=[]", override})
            .resolved;
    const std::string wide = "SG_ STEP : 8|32@1+";
    text.replace(text.find(wide), wide.size(), "SG_ STEP : 8|6@1+");
    try {
      experiment_from_text(text, "narrow");
    } catch (const UsageError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  CHECK(narrow_problems("network.commands=[{after_step: 43, mode: '111', lead_steps: 20}]") == "");
  CHECK(narrow_problems("network.commands=[{after_step: 44, mode: '111', lead_steps: 20}]")
            .find("6 bits, too few for 64") != std::string::npos);
  CHECK(narrow_problems("attacks=[{name: r, match: {messages: [BreakerCommand]}, action: inject, "
                        "mode: '111', window: {last_step: 54}, lead_steps: 10}]")
            .find("too few for 64") != std::string::npos);
  says("attacks.0.mode=011", "none of the plant's modes");
  says("network.dbc_text=x", "not both");
  says("steps=5000000000", "steps");
  const std::string single =
      testing::problems_of("fifth_order", {"network.command={message: StepTick, mode: STEP}"});
  UNSCOPED_INFO(single);
  CHECK(single.find("no modes to switch between") != std::string::npos);
}

TEST_CASE("what a rule adds to a sensor's signal is the input that estimators are scored against") {
  const std::string wave = "waveform: sine, amplitude: 2, frequency_radps: 0.3";
  const auto load = [](const std::string& signals, const std::string& rules) {
    return load_experiment(testing::scenario("attack_locations"),
                           {"steps=50", "plant.mode_changes=[{mode: a124, from_step: 1}]",
                            "plant.signal_attacks=[" + signals + "]", "attacks=[" + rules + "]"});
  };
  const std::string on_bus = "{name: lie, match: {messages: [Outputs]}, action: add, signal: Y2, ";
  const Experiment by_plant = load("{channel: sensor_2, " + wave + "}", "");
  const Experiment by_bus = load("", on_bus + "value: {distribution: waveform, " + wave + "}}");
  // Y5 has no channel of its own: what is added there is no input of the model.
  const Experiment elsewhere =
      load("",
           "{name: lie, match: {messages: [Outputs]}, action: add, signal: Y5, "
           "value: {distribution: waveform, " +
               wave + "}}");
  Simulation a(by_plant, 0), b(by_bus, 0), c(elsewhere, 0);
  while (a.advance() && b.advance() && c.advance()) {
    const double expected = 2.0 * std::sin(0.3 * static_cast<double>(a.truth().step - 1));
    CHECK(a.true_attack()[2] == Approx(expected).margin(1e-12));
    for (std::size_t channel = 0; channel < 5; ++channel) {
      CHECK(std::abs(a.true_attack()[channel] - b.true_attack()[channel]) < 1e-5);
      CHECK(c.true_attack()[channel] == 0.0);
    }
    CHECK((a.estimates()[0]->mean - b.estimates()[0]->mean).norm() < 1e-4);
    REQUIRE(b.rule_signals().size() == 1);
    CHECK(b.rule_signals()[0].factor == Approx(expected).margin(1e-12));
    CHECK(a.rule_signals().empty());
  }
}

TEST_CASE("positions in whole millimetres are the same, but for their rounding") {
  const std::string scenario = testing::scenario("turning_target");
  // By fixed amounts: what is drawn for a frame depends on its identifier.
  const std::string attacks =
      "attacks=[{name: attack, action: arm, probability: 0.3, draw: step}, "
      "{name: dos, given: attack, action: force, signals: [X, Y], probability: 0.1, draw: step}, "
      "{name: bias, given: attack, unless: dos, action: add, signals: [X, Y], probability: 0.3, "
      "draw: step, value: {value: 1.2345}}, "
      "{name: scaling, given: attack, unless: dos, action: scale, signals: [X, Y], "
      "probability: 0.1, draw: step, value: {value: 0.95}}]";
  const Experiment in_metres = load_experiment(scenario, {attacks});
  const Experiment in_millimetres =
      load_experiment(scenario, {attacks, "network.messages=[PositionScaled]"});
  Simulation metres(in_metres, 1), millimetres(in_millimetres, 1);
  REQUIRE(metres.estimates().size() == millimetres.estimates().size());
  REQUIRE(metres.estimates().size() > 5);
  int num_forced = 0, num_rounded = 0;
  while (metres.advance()) {
    REQUIRE(millimetres.advance());
    const std::vector<double>& exact = metres.measurements().values;
    const std::vector<double>& rounded = millimetres.measurements().values;
    REQUIRE(exact.size() == 2);
    REQUIRE(rounded.size() == 2);
    CHECK(metres.true_mode() == millimetres.true_mode());
    for (std::size_t i = 0; i < 2; ++i) {
      // Rounded by the sensor and, where the attacker touched it, once more.
      CHECK(std::abs(exact[i] - rounded[i]) < 0.0011);
      CHECK(std::abs(1000.0 * rounded[i] - std::round(1000.0 * rounded[i])) < 1e-6);
      CHECK((exact[i] == 0.0) == (rounded[i] == 0.0));
      if (exact[i] == 0.0) ++num_forced;
      if (std::abs(exact[i] - rounded[i]) > 0.0001) ++num_rounded;
    }
    for (std::size_t i = 0; i < metres.estimates().size(); ++i) {
      CHECK((metres.estimates()[i]->mean - millimetres.estimates()[i]->mean).norm() < 0.01);
    }
  }
  CHECK_FALSE(millimetres.advance());
  CHECK(num_forced > 0);
  CHECK(num_rounded > 400);
}

}  // namespace holdfast
