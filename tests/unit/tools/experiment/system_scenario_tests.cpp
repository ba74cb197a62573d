// Scenarios with vector measurements: what they say, and what their estimators come to.
#include "tests/support/catch.h"
#include "tests/support/texts.h"
#include "tests/unit/tools/experiment/scenario_texts.h"
#include "tools/campaign/run_result.h"
#include "tools/experiment.h"
#include "tools/simulation.h"

namespace holdfast {

using namespace testing;

namespace {

const char* const kHybrid =
    "{name: hybrid, method: hybrid_bernoulli, delivery_probability: same, attack_models: [{terms: "
    "[{std: 10}]}], start: {std: 0.1}, packet_box: {low: -10, high: 5}}";

}  // namespace

TEST_CASE("a resolved vector scenario stands for itself, matrices included") {
  for (const char* name : {"fifth_order", "ieee14", "ieee14_substitution", "ieee14_waveform"}) {
    INFO(name);
    const Experiment read = load_experiment(scenario(name));
    const Experiment again = experiment_from_text(read.resolved, "resolved");
    CHECK(again.resolved == read.resolved);
    const YAML::Node model = YAML::Load(read.resolved)["plant"]["model"];
    const YAML::Node A = model["matrices"] ? model["matrices"]["A"] : model["A"];
    REQUIRE(A.size() == static_cast<std::size_t>(read.plant.system()->model().num_states()));
    CHECK(A[0][1].as<double>() == read.plant.system()->model().A(0, 1));
    Simulation a(read, 0), b(again, 0);
    for (int k = 0; k < 10; ++k) {
      REQUIRE(a.advance());
      REQUIRE(b.advance());
      CHECK(a.estimates()[0]->mean == b.estimates()[0]->mean);
    }
  }
}

TEST_CASE("an estimator may believe another model of the network than the plant's") {
  const Experiment experiment =
      load_experiment(scenario("ieee14"),
                      {"plant.model.nonlinear=true", "estimators.hybrid.model={nonlinear: false}",
                       "estimators.nearest.model={preset: realistic}"});
  CHECK_FALSE(experiment.plant.system()->model().is_linear());
  Simulation simulation(experiment, 0);
  for (int k = 0; k < 5; ++k) REQUIRE(simulation.advance());
  // Heavier rotors answer less: the second filter predicts otherwise from the same packets.
  CHECK(simulation.estimates()[0]->mean != simulation.estimates()[1]->mean);
}

TEST_CASE("same ties delivery and substitution probabilities to the rules") {
  const auto probability = [](const std::vector<std::string>& overrides) {
    const Experiment experiment = load_experiment(scenario("ieee14"), overrides);
    return YAML::Load(experiment.resolved)["estimators"][0]["delivery_probability"]
        .as<std::string>();
  };
  CHECK(probability({}) == "same");
  // One frame of two is lost and the filter knows it: a tied pd makes another estimate than 0.95.
  const std::vector<std::string> half = {"attacks.loss.probability=0.5"};
  std::vector<std::string> apart = half;
  apart.emplace_back("estimators.hybrid.delivery_probability=0.95");
  std::vector<std::string> equal = half;
  equal.emplace_back("estimators.hybrid.delivery_probability=0.5");
  const auto r_after = [](const std::vector<std::string>& overrides) {
    const Experiment experiment = load_experiment(scenario("ieee14"), overrides);
    Simulation simulation(experiment, 0);
    for (int k = 0; k < 8; ++k) simulation.advance();
    return simulation.estimates()[0]->attack_probability;
  };
  CHECK(r_after(half) == r_after(equal));
  CHECK(r_after(half) != r_after(apart));
  // A key that is not there is not tied.
  const Experiment silent = load_experiment(
      scenario("ieee14"),
      {"attacks.loss.probability=0.5", "estimators=[{name: a, method: hybrid_bernoulli}]"});
  const YAML::Node told = YAML::Load(silent.resolved)["estimators"][0];
  CHECK(told["delivery_probability"].as<double>() == 0.95);
  CHECK(told["substitution_probability"].as<double>() == 0.0);
  CHECK(mentions(problems_of("ieee14", {"attacks.loss.probability=1"}), "nothing arrive"));
  CHECK(mentions(problems_of("ieee14", {"attacks.loss.window={first_step: 5}"}),
                 "cannot be the same as rule 'loss'"));
}

TEST_CASE("a forced packet counts as a substituted one, and no condition has one probability") {
  const auto r_after = [](const std::vector<std::string>& overrides) {
    const Experiment experiment = load_experiment(scenario("ieee14_substitution"), overrides);
    Simulation simulation(experiment, 0);
    for (int k = 0; k < 8; ++k) simulation.advance();
    return simulation.estimates()[0]->attack_probability;
  };
  const std::string force = "attacks.substitution.action=force";
  CHECK(r_after({force}) == r_after({force, "estimators.hybrid.substitution_probability=0.3"}));
  CHECK(r_after({force}) != r_after({force, "estimators.hybrid.substitution_probability=0.1"}));
  CHECK(mentions(problems_of("ieee14", {"attacks=[{name: armed, action: arm, probability: 0.5}, "
                                        "{name: loss, given: armed, action: drop}]"}),
                 "cannot be the same as rule 'loss'"));
}

TEST_CASE("the clairvoyant filter sees authentic packets and attacked steps, and nothing else") {
  const Experiment experiment =
      load_experiment(scenario("ieee14"), {"plant.signal_attacks.0.window.first_step=20",
                                           "plant.signal_attacks.1.window.first_step=20"});
  Simulation simulation(experiment, 3);
  const std::size_t clairvoyant = simulation.entries().size() - 1;
  REQUIRE(simulation.entries()[clairvoyant]->name == "clairvoyant");
  bool had_loss = false;
  for (int k = 1; k <= 60; ++k) {
    REQUIRE(simulation.advance());
    const Estimate& estimate = *simulation.estimates()[clairvoyant];
    CHECK(simulation.has_signal_attack() == (k >= 20));
    CHECK(simulation.is_attacked() == (k >= 20));
    CHECK(estimate.attack_probability == (k >= 20 ? 1.0 : 0.0));
    CHECK(simulation.num_authentic() <= 1);
    CHECK((estimate.outcome == StepOutcome::kNoPackets) == (simulation.num_authentic() == 0));
    had_loss = had_loss || simulation.num_authentic() == 0;
  }
  CHECK(had_loss);
}

TEST_CASE("what makes a step attacked is the scenario's word") {
  const auto attacked_steps = [](const std::string& truth) {
    const Experiment experiment =
        load_experiment(scenario("ieee14"), {"steps=60", "campaign.attack_truth=" + truth,
                                             "estimators=[" + std::string(kHybrid) + "]",
                                             "attacks.injection.window={last_step: 5}"});
    double sum = 0.0;
    for (const double one : simulate_run(experiment, 0, 0).is_attacked) sum += one;
    return sum;
  };
  const double signals = attacked_steps("signals"), frames = attacked_steps("frames");
  CHECK(signals == 11.0);  // steps 50 to 60
  CHECK(frames >= 4.0);
  CHECK(attacked_steps("any") > std::max(signals, frames));
}

TEST_CASE("wrong vector scenarios are told, all problems at once") {
  const std::string text = problems_of(
      "ieee14",
      {"plant.model.victims=[3, 15]", "plant.signal_attacks.0.channel=load_bus_77_pu",
       "estimators.hybrid.packet_box={low: 5, high: -10}", "estimators.clairvoyant.input=received",
       "campaign.windows=[{name: a, first_step: 9, last_step: 2}, {name: a, without: [{first_step: "
       "5, last_step: 4}]}]"});
  INFO(text);
  for (const char* part : {"victims", "load_bus_77_pu", "packet_box", "knows the truth",
                           "lies before first_step", "'a' is taken"}) {
    CHECK(mentions(text, part));
  }
  CHECK(mentions(problems_of("ieee14", {"network.signals=[DELTA1]"}),
                 "1 messages of 1 signals for 10"));
  // Nor does a DBC that is not there make a rule act on some messages only.
  const std::string no_dbc = problems_of("ieee14", {"network.dbc=nowhere.dbc"});
  CHECK(mentions(no_dbc, "nowhere.dbc"));
  CHECK_FALSE(mentions(no_dbc, "cannot be the same"));
  // A model that cannot be used is told once, not by all that stand on it.
  const std::string broken = problems_of("fifth_order", {"plant.model.A=[[1, 2]]"});
  CHECK(mentions(broken, "A must be"));
  CHECK_FALSE(mentions(broken, "estimators"));
  CHECK_FALSE(mentions(broken, "network"));
  CHECK(mentions(problems_of("fifth_order", {"plant.model.R=[[0, 0], [0, 0]]"}), "R must be"));
  CHECK(mentions(problems_of("ieee14", {"estimators.hybrid.method=secure_particle_filter"}),
                 "none of those for this plant"));
  CHECK(mentions(problems_of("binary_tracking", {"estimators.secure.method=hybrid_bernoulli"}),
                 "none of those for this plant"));
  CHECK(mentions(problems_of("ieee14", {"plant.kind=ieee15"}), "binary_target, linear, ieee14"));
  CHECK(mentions(problems_of("ieee14", {"plant.model.matrices={A: [[1]]}"}), "leave it out"));
}

}  // namespace holdfast
