// What holdfast-check says of scenarios whose right answers are known.

#include "tools/mode_check.h"

#include <nlohmann/json.hpp>

#include "tests/support/catch.h"

namespace holdfast {
namespace {

std::string scenario_file(const std::string& name) {
  return std::string(HOLDFAST_SOURCE_DIR) + "/scenarios/" + name + ".yaml";
}

// Two sensors of two states; what is attacked is told by the modes.
ModeCheck check_small(const std::string& A, const std::string& C, const std::string& modes,
                      const ModeCheckOptions& options = {}) {
  const std::string text =
      "holdfast: 1\nname: small\nsteps: 10\n"
      "plant: {kind: linear, start_std: 1, model: {A: " +
      A + ", C: " + C +
      ", H: [[1, 0], [0, 1]], Q: [[0.01, 0], [0, 0.01]], R: [[0.01, 0], [0, 0.01]], "
      "attack_names: [left, right]}, " +
      modes +
      "}\n"
      "network: {sensor_bus: none, monitor_bus: none, messages: [Outputs], signals: [Y1, Y2], "
      "counter_signal: STEP, tick: {message: StepTick, signal: STEP}, dbc_text: \"" +
      std::string(
          "BO_ 256 Outputs: 18 Plant\\n SG_ Y1 : 0|64@1- (1,0) [0|0] \\\"\\\" Monitor\\n"
          " SG_ Y2 : 64|64@1- (1,0) [0|0] \\\"\\\" Monitor\\n"
          " SG_ STEP : 128|16@1+ (1,0) [0|65535] \\\"\\\" Monitor\\n"
          "BO_ 2032 StepTick: 2 Plant\\n SG_ STEP : 0|16@1+ (1,0) [0|65535] \\\"\\\" Monitor\\n"
          "SIG_VALTYPE_ 256 Y1 : 2;\\nSIG_VALTYPE_ 256 Y2 : 2;\\n") +
      "\"}\nestimators: []\n";
  return check_modes(experiment_from_text(text, "small"), options);
}

const char* const kEither = "modes: [{name: l, channels: [left]}, {name: r, channels: [right]}]";
const char* const kBoth = "modes: [{name: both, channels: [left, right]}]";

const ModeCheck::Pair& pair_of(const ModeCheck& check, int truth, int rival) {
  for (const ModeCheck::Pair& pair : check.pairs) {
    if (pair.truth == truth && pair.rival == rival) return pair;
  }
  throw std::logic_error("no such pair");
}

bool warns(const ModeCheck& check, const std::string& text) {
  for (const std::string& warning : warnings_of(check)) {
    if (warning.find(text) != std::string::npos) return true;
  }
  return false;
}

}  // namespace

TEST_CASE("three areas: every mode is correctable and told from every other") {
  const ModeCheck check = check_modes(load_experiment(scenario_file("three_area")), {});
  REQUIRE(check.theory.size() == 5);
  for (const ModeTheory& mode : check.theory) {
    CHECK(mode.is_correctable());
    CHECK(mode.zeros.empty());
  }
  CHECK(check.correctable_most == 3);
  CHECK(check.models_needed == 5.0);
  for (const ModeCheck::Pair& pair : check.pairs) {
    CHECK(pair.attacked.per_step() > 0.4);
    // The decoupled output is free of the attack: it makes no difference at all.
    CHECK(pair.attacked.per_step() == Approx(pair.quiet.per_step()).epsilon(1e-9));
  }
  CHECK(warnings_of(check).empty());
}

TEST_CASE("attack locations: zeros, correctable sets and divergences of the method page") {
  const ModeCheck check = check_modes(load_experiment(scenario_file("attack_locations")), {});
  const std::vector<std::vector<double>> zeros = {{0.5}, {0.5}, {0.7, 0.5}, {0.7}, {0.7, 0.5}};
  REQUIRE(check.theory.size() == zeros.size());
  for (std::size_t i = 0; i < zeros.size(); ++i) {
    REQUIRE(check.theory[i].zeros.size() == zeros[i].size());
    for (std::size_t j = 0; j < zeros[i].size(); ++j) {
      CHECK(std::abs(check.theory[i].zeros[j] - zeros[i][j]) < 1e-8);
    }
    CHECK(check.theory[i].is_correctable());
  }
  CHECK(check.correctable_most == 5);
  CHECK(check.models_needed == 5.0);
  CHECK(pair_of(check, 0, 2).quiet.per_step() == Approx(-0.0900).margin(5e-4));
  CHECK(pair_of(check, 0, 2).is_distinguishable == true);
  CHECK(warns(check, "while nothing is attacked, mode a123 is taken for mode a134"));
  CHECK_FALSE(warns(check, "under the scenario's attacks"));

  // A tenth of the attack: the true mode loses to two rivals.
  const ModeCheck weak = check_modes(
      load_experiment(scenario_file("attack_locations"), {"plant.attack_gain=0.1"}), {});
  CHECK(warns(weak, "under the scenario's attacks"));
  CHECK_THROWS_AS(check_modes(load_experiment(scenario_file("binary_tracking")), {}), UsageError);
}

TEST_CASE("two sensors that cannot be attacked together, and what protects from it") {
  const ModeCheck both = check_small("[[0.1, 1], [0, 1.2]]", "[[1, 0], [0, 1]]", kBoth);
  CHECK(warns(both,
              "left and right cannot be attacked together: zero at 1.2 outside the unit circle"));
  CHECK(both.correctable_most == 1);
  CHECK(both.protecting == std::vector<int>{0, 1});
  const ModeCheck either = check_small("[[0.1, 1], [0, 1.2]]", "[[1, 0], [0, 1]]", kEither);
  CHECK(either.bad_sets.empty());
  CHECK(either.models_needed == 2.0);
  // What the one sensor hides the other one shows, but an attack on both would fit either story.
  CHECK(warns(either, "modes l and r cannot always be told apart"));
  const ModeCheck stable = check_small("[[0.1, 1], [0, 0.2]]", "[[1, 0], [0, 1]]", kBoth);
  CHECK(stable.bad_sets.empty());
  CHECK(stable.correctable_most == 2);
  CHECK(to_text(stable).find("No warning.") != std::string::npos);
}

TEST_CASE("a plant that nobody can follow is told, attacked or not") {
  // The second state grows and is not read.
  const ModeCheck check = check_small("[[0.1, 0], [0, 1.2]]", "[[1, 0], [1, 0]]", kEither);
  CHECK(warns(check, "cannot be followed even while nothing is attacked: zero at 1.2"));
  CHECK(check.correctable_most == 0);
  CHECK(check.protecting.empty());
  const ModeCheck sound = check_small("[[0.1, 0.3], [0, 0.9]]", "[[1, 0], [1, 0.5]]", kEither);
  CHECK_FALSE(warns(sound, "cannot be followed"));
}

TEST_CASE("a mode beyond --attacked-most is judged, too") {
  ModeCheckOptions options;
  options.attacked_most = 1;
  const ModeCheck check = check_small("[[0.1, 1], [0, 1.2]]", "[[1, 0], [0, 1]]", kBoth, options);
  CHECK(warns(check, "mode b"));
  CHECK(check.bad_sets.empty());
}

TEST_CASE("what is not looked at is said") {
  // The units decide between modes of different sizes, by all but evidence.
  const ModeCheck sizes =
      check_small("[[0.5, 0], [0, 0.4]]", "[[1, 0], [0, 1]]",
                  "modes: [{name: none, channels: []}, {name: l, channels: [left]}]");
  CHECK(warns(sizes, "use evidence"));
  ModeCheckOptions evidence;
  evidence.likelihood = InputLikelihood::kEvidence;
  CHECK_FALSE(warns(
      check_small("[[0.5, 0], [0, 0.4]]", "[[1, 0], [0, 1]]",
                  "modes: [{name: none, channels: []}, {name: l, channels: [left]}]", evidence),
      "use evidence"));
  const ModeCheck areas = check_modes(
      load_experiment(scenario_file("three_area"), {"steps=20", "attacks.0.window.last_step=5000"}),
      {});
  const auto notes = [](const ModeCheck& check, const std::string& part) {
    return std::ranges::any_of(check.notes, [&part](const std::string& note) {
      return note.find(part) != std::string::npos;
    });
  };
  CHECK(notes(areas, "begin after step 300"));
  CHECK(notes(areas, "rules do to frames"));
  for (const ModeCheck::Pair& pair : areas.pairs)
    CHECK(pair.is_distinguishable);  // of two topologies
  CHECK_FALSE(warns(areas, "told apart"));
}

TEST_CASE("equal sensors are alike while nothing is attacked") {
  const ModeCheck check = check_small("[[0.9, 0], [0.1, 0.8]]", "[[1, 1], [1, 1]]", kEither);
  CHECK(std::abs(pair_of(check, 0, 1).quiet.per_step()) < 1e-9);
  CHECK(warns(check, "modes l and r are alike while nothing is attacked"));
  const auto json = nlohmann::json::parse(to_json(check));
  CHECK(json.at("pairs").size() == 2);
  CHECK(json.at("modes").at(0).at("is_strongly_detectable") == true);
  CHECK(json.at("warnings").size() == warnings_of(check).size());
}

TEST_CASE("topologies that cannot be are refused, and none of them crashes") {
  const auto says = [](const char* name, const std::string& override, const std::string& part) {
    INFO(override);
    std::string text;
    try {
      load_experiment(scenario_file(name), {override});
    } catch (const UsageError& error) {
      text = error.what();
    }
    INFO(text);
    CHECK(text.find(part) != std::string::npos);
  };
  says("three_area", "plant.model.ties=[]", "at least one topology");
  says("three_area", "estimators.0.model.ties=[]", "at least one topology");
  says("three_area", "plant.model.ties=[\"111\", \"111\"]", "given twice");
  says("attack_locations", "plant.model.topologies=[]", "at least one topology");
  says("attack_locations", "plant.model.topologies=[{name: a}, {name: a}]", "given twice");
  says("attack_locations",
       "plant.model.topologies=[{name: a}, {name: b, attack_names: [v, w, x, y, z]}]",
       "same names");
}

TEST_CASE("numbers that overflow are told, not taken for an answer") {
  ModeCheckOptions options;
  options.num_steps = 60;
  const ModeCheck check = check_modes(
      load_experiment(scenario_file("attack_locations"), {"plant.attack_gain=1e300"}), options);
  CHECK(warns(check, "were not compared"));
}

}  // namespace holdfast
