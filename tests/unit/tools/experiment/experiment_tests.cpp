#include "tools/experiment.h"

#include <fstream>
#include <sstream>

#include "common/configuration_text.h"
#include "tests/support/catch.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/texts.h"
#include "tests/unit/tools/experiment/scenario_texts.h"
#include "tools/simulation.h"

namespace holdfast {

using namespace testing;

namespace {

const SecureParticleFilterMaker& maker_of(const Experiment& experiment, const std::string& name) {
  return *experiment.estimator(name).make.target<SecureParticleFilterMaker>();
}

}  // namespace

TEST_CASE("a resolved scenario stands for itself") {
  for (const char* name : {"binary_tracking", "binary_radio"}) {
    const Experiment read = load_experiment(scenario(name));
    // Its DBC text is inside, so no folder is needed, and reading it again changes nothing.
    const Experiment again = experiment_from_text(read.resolved, "resolved");
    CHECK(again.resolved == read.resolved);
    Simulation a(read, 0), b(again, 0);
    for (int k = 0; k < 10; ++k) {
      REQUIRE(a.advance());
      REQUIRE(b.advance());
      CHECK(a.estimates()[0]->mean == b.estimates()[0]->mean);
    }
  }
}

TEST_CASE("a vendor's large DBC has its place in a scenario, too many values have not") {
  const TemporaryFolder folder;
  std::ostringstream dbc;
  dbc << std::ifstream(std::string(HOLDFAST_SOURCE_DIR) + "/scenarios/turning_target.dbc").rdbuf();
  for (int i = 0; i < 6000; ++i)
    dbc << "\nBO_ " << 0x80010000 + i << " Unused" << i << ": 8 Vendor\n SG_ Value : 0|16@1+ (1,0) "
        << "[0|0] \"\" Vector__XXX\n";
  std::ofstream(folder.file("vendor.dbc")) << dbc.str();
  const Experiment large =
      load_experiment(scenario("turning_target"), {"network.dbc=" + folder.file("vendor.dbc")});
  CHECK(large.resolved.size() > 400'000);
  CHECK(experiment_from_text(large.resolved, "resolved").resolved == large.resolved);

  std::string samples;
  for (std::size_t i = 0; i < kValuesMax; ++i) samples += "0,";
  CHECK_THROWS_WITH(
      load_experiment(
          scenario("fifth_order"),
          {"plant.signal_attacks=[{channel: a_1, waveform: samples, samples: [" + samples + "]}]"}),
      Catch::Contains("fifth_order.yaml, with its defaults:") &&
          Catch::Contains("more than 50000 values"));
}

TEST_CASE("a scenario out of a log opens no file, whatever it names") {
  std::string text = load_experiment(scenario("fifth_order")).resolved;
  const auto with = [&text](const std::string& before, const std::string& after) {
    std::string other = text;
    const std::size_t at = other.find(before);
    REQUIRE(at != std::string::npos);
    return other.replace(at, before.size(), after);
  };
  CHECK_NOTHROW(experiment_from_text(text, "log"));
  CHECK_THROWS_WITH(
      experiment_from_text(with("dbc_text:", "dbc: /dev/zero\n  unknown:"), "log"),
      Catch::Contains("network.dbc: a scenario out of a log or results names no files"));
  CHECK_THROWS_WITH(
      experiment_from_text(with("waveform: constant", "waveform: samples\n      file: /dev/zero"),
                           "log"),
      Catch::Contains("file: a scenario out of a log or results names no files"));
}

TEST_CASE("what costs memory for each step is bounded before it is read") {
  const auto listed = [](const std::string& key, int count) {
    std::string text = key + "=[";
    for (int i = 0; i < count; ++i) text += "{},";
    return text + "]";
  };
  for (const char* key : {"estimators", "state_groups", "campaign.windows", "attacks"}) {
    INFO(key);
    CHECK_THROWS_WITH(load_experiment(scenario("binary_tracking"), {listed(key, 10'000)}),
                      Catch::Contains("has 10000 entries, at most"));
  }
}

TEST_CASE("the word same ties a believed probability to the true one") {
  const Experiment moved = load_experiment(
      scenario("binary_tracking"), {"attacks.flip.probability=0.3", "plant.attack.dos=0.25"});
  const SecureParticleFilterMaker& secure = maker_of(moved, "secure");
  CHECK(secure.assumes.flip == std::vector<double>(16, 0.3));
  CHECK(secure.assumes.dos == std::vector<double>(16, 0.25));
  CHECK(secure.assumes.deception == std::vector<double>(16, 0.1));
  CHECK(maker_of(moved, "neglect").assumes.flip == std::vector<double>(16, 0.0));

  const Experiment apart =
      load_experiment(scenario("binary_tracking"),
                      {"attacks.flip.probability=0.3", "estimators.secure.assumes.flip=0.1"});
  CHECK(maker_of(apart, "secure").assumes.flip == std::vector<double>(16, 0.1));
}

TEST_CASE("two flips of one sensor cancel each other") {
  const Experiment experiment = load_experiment(
      scenario("binary_tracking"), {"attacks=[{name: a, match: {messages: [Sensor03]}, "
                                    "probability: 0.2, action: flip, signal: DETECT},"
                                    " {name: b, match: {messages: [Sensor03]}, probability: 0.5, "
                                    "action: flip, signal: DETECT}]"});
  CHECK(maker_of(experiment, "secure").assumes.flip[2] == Approx(0.2 * 0.5 + 0.8 * 0.5));
  CHECK(maker_of(experiment, "secure").assumes.flip[3] == 0.0);
}

TEST_CASE("a flip that acts only at times is not tied to a belief without a word") {
  const std::string text = problems_of("binary_tracking", {"attacks.flip.window={first_step: 50}"});
  CHECK(mentions(text, "acts only at times"));
  CHECK(problems_of("binary_tracking",
                    {"attacks.flip.window={first_step: 50}", "estimators.secure.assumes.flip=0.1"})
            .empty());
}

TEST_CASE("an arming rule that acts in bursts is not tied to a belief without a word") {
  const std::string rules = "attacks=[{name: a, action: arm, ";
  const std::string same =
      "estimators=[{name: g, method: gslr, assumes: {attack_probability: same}, "
      "start: {mean: [200, 200, 15, 15], std: 10}}]";
  for (const std::string frequency :
       {"chain: {to_bad: 0.1, to_good: 0.1}", "every: 2", "times: 5"}) {
    CHECK(mentions(problems_of("turning_target", {rules + frequency + "}]", same}),
                   "does not act with one probability"));
  }
}

TEST_CASE("a flip under a condition is not tied to a belief, an arming rule ties nothing") {
  const std::string armed =
      "attacks=[{name: armed, action: arm, probability: 0.5}, {name: lie, "
      "probability: 0.2, action: flip, signal: DETECT";
  const std::string apart = "estimators.secure.assumes.flip=0.1";
  for (const char* condition : {"given", "unless"}) {
    const std::string attacks = armed + ", " + condition + ": armed}]";
    CHECK(mentions(problems_of("binary_tracking", {attacks}), "cannot be the same as rule 'lie'"));
    CHECK(problems_of("binary_tracking", {attacks, apart}).empty());
  }
  const Experiment free = load_experiment(scenario("binary_tracking"), {armed + "}]"});
  CHECK(maker_of(free, "secure").assumes.flip == std::vector<double>(16, 0.2));
}

TEST_CASE("probabilities may differ between sensors") {
  const std::string list = "[1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]";
  const Experiment experiment =
      load_experiment(scenario("binary_tracking"), {"plant.attack.dos=" + list});
  CHECK(experiment.plant.binary_target()->options.attack.dos[0] == 1.0);
  CHECK(experiment.plant.binary_target()->options.attack.dos[1] == 0.0);
  CHECK(mentions(problems_of("binary_tracking", {"plant.attack.dos=[0.1, 0.2]"}),
                 "2 numbers, must be 16"));
}

TEST_CASE("an estimator may believe another model than the plant's") {
  const Experiment experiment =
      load_experiment(scenario("binary_tracking"), {"estimators.secure.model={threshold: 0.5}"});
  CHECK(maker_of(experiment, "secure").model.threshold == 0.5);
  CHECK(maker_of(experiment, "secure").model.source_power == 4000.0);
  CHECK(experiment.plant.binary_target()->model.threshold == 0.3);
}

TEST_CASE("the resolved model holds its matrices as numbers") {
  const Experiment experiment =
      load_experiment(scenario("binary_tracking"), {"plant.model.step_s=2"});
  const YAML::Node matrices = YAML::Load(experiment.resolved)["plant"]["model"]["matrices"];
  CHECK(matrices["F"][0][1].as<double>() == 2.0);
  CHECK(matrices["F"][2][3].as<double>() == 2.0);
  CHECK(matrices["Q"][0][0].as<double>() == Approx(0.002025 * 8.0 / 3.0).epsilon(1e-15));
  CHECK(matrices["Q"][1][0].as<double>() == Approx(0.002025 * 2.0).epsilon(1e-15));
  CHECK(matrices["Q"][0][2].as<double>() == 0.0);
  CHECK(mentions(
      problems_of(
          "binary_tracking",
          {"plant.model.matrices.F=[[1, 9, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1], [0, 0, 0, 1]]"}),
      "follows from step_s"));
}

TEST_CASE("the kernels of the estimators are told as they are") {
  CHECK(load_experiment(scenario("binary_tracking")).kernel_text() == particle_kernel_name());
  CHECK(load_experiment(scenario("binary_tracking"),
                        {"estimators.secure.kernel=portable", "estimators.neglect.kernel=portable",
                         "estimators.uncorrupted.kernel=portable"})
            .kernel_text() == "portable");
  if (std::string(particle_kernel_name()) == "portable") return;
  const std::string mixed =
      load_experiment(scenario("binary_tracking"), {"estimators.secure.kernel=portable"})
          .kernel_text();
  CHECK(mentions(mixed, "secure=portable"));
  CHECK(mentions(mixed, std::string("neglect=") + particle_kernel_name()));
}

TEST_CASE("a clock of the driver's own goes without the sensors' counters") {
  CHECK_FALSE(load_experiment(scenario("binary_tracking"), {"network.close_step=clock"})
                  .assembler.check_counter);
  CHECK(mentions(
      problems_of("binary_tracking", {"network.close_step=clock", "network.counter_check=match"}),
      "own clock"));
}

TEST_CASE("every problem of a scenario is told at once, with its place") {
  const std::string text =
      problems_of("binary_tracking", {"plant.attack.dos=1.5", "plant.model.glint.variance_1=-1",
                                      "sead=3", "steps=many", "network.messages=[Sensor01, Nobody]",
                                      "estimators.secure.particles=0", "attacks.flip.action=melt"});
  for (const char* part :
       {"plant.attack.dos: 1.5 must be in [0, 1]", "plant.model.glint.variance_1",
        "sead: unknown key", "steps: 'many' is no whole number", "Nobody", "particles", "melt"}) {
    INFO(part << " in\n" << text);
    CHECK(mentions(text, part));
  }
  CHECK(mentions(problems_of("binary_tracking", {"estimators.neglect.name=secure"}), "is taken"));
  CHECK(mentions(problems_of("binary_tracking", {"network.sensor_bus=none"}), "both buses"));
  CHECK(mentions(problems_of("binary_tracking", {"network.sensor_bus='socketcan:vcan0'",
                                                 "network.monitor_bus='socketcan:vcan0'"}),
                 "circles"));
  CHECK(mentions(problems_of("binary_tracking", {"network.sensor_bus='udp:239.1.2.3:5001'",
                                                 "network.monitor_bus='udp:239.1.2.3:05001'"}),
                 "circles"));
  CHECK(mentions(problems_of("binary_tracking", {"state_groups=[{name: a, states: []}]"}),
                 "at least one"));
  CHECK(mentions(problems_of("binary_tracking", {"state_groups=[{name: a, states: [1, 1]}]"}),
                 "once"));
  CHECK(mentions(problems_of("binary_tracking",
                             {"state_groups=[{name: a, states: [1]}, {name: a, states: [2]}]"}),
                 "is taken"));
  CHECK(mentions(problems_of("binary_tracking", {"estimators.neglect.name=plant"}),
                 "another process"));
  CHECK(mentions(problems_of("binary_tracking", {"holdfast=2"}), "holdfast: 2 must be in [1, 1]"));
}

TEST_CASE("an unknown estimator is told with those that there are") {
  const Experiment experiment = load_experiment(scenario("binary_tracking"));
  CHECK_THROWS_WITH(
      experiment.estimator("secur"),
      "no estimator 'secur' in scenario binary_tracking; it has: secure, neglect, uncorrupted");
}

}  // namespace holdfast
