// A bias that stays below what the monitor's filter would notice.
#include <algorithm>
#include <cmath>

#include "tests/support/catch.h"
#include "tests/unit/tools/experiment/scenario_texts.h"
#include "tools/simulation.h"

namespace holdfast {
namespace {

constexpr double kResidualMost = 2.0;

struct StealthRun {
  double largest_residual = 0.0;  // normalised, of the steps that were touched
  double last_error_m = 0.0;
  double largest_added_m = 0.0;
  std::int64_t num_touched = 0, num_exceeding = 0;
};

// The filter of the monitor that the attacker has in mind says what the residuals are.
StealthRun run_stealth(const std::string& value, const std::string& stealth, std::uint32_t run) {
  const Experiment experiment = load_experiment(
      testing::scenario("turning_target"),
      {"steps=200", "plant.start_std=[1, 1, 0.5, 0.5]",
       "attacks=[{name: push, match: {messages: [Position]}, window: {first_step: 20}, action: "
       "add, "
       "signals: [X, Y], value: " +
           value + stealth + "}]",
       "estimators=[{name: kalman, method: kalman_filter, start: {step: 0, mean: [200, 200, 15, "
       "15], std: [1, 1, 0.5, 0.5]}}]"});
  Simulation simulation(experiment, run);
  StealthRun played;
  while (simulation.advance()) {
    const Estimate& estimate = *simulation.estimates()[0];
    played.last_error_m = (estimate.mean.head(2) -
                           Eigen::Map<const Eigen::VectorXd>(simulation.truth().state.data(), 2))
                              .norm();
    if (simulation.attack_records().empty()) continue;
    ++played.num_touched;
    const AttackRecord& record = simulation.attack_records().front();
    const DbcSignal& x = *experiment.layout.dbc.find("Position")->find("X");
    played.largest_added_m =
        std::max(played.largest_added_m,
                 std::abs(x.unpack(record.forwarded.bytes()) - x.unpack(record.original.bytes())));
    const double residual = std::sqrt(
        estimate.innovation.dot(estimate.innovation_covariance.ldlt().solve(estimate.innovation)));
    played.largest_residual = std::max(played.largest_residual, residual);
    if (residual > kResidualMost) ++played.num_exceeding;
  }
  return played;
}

const std::string kStealth = ", stealth: {residual_most: 2}";

}  // namespace

TEST_CASE("no residual that an attack touched exceeds what it allows itself, and it uses it all") {
  for (std::uint32_t run = 0; run < 5; ++run) {
    const StealthRun bounded = run_stealth("{value: [30, -10]}", kStealth, run);
    // float32 signals of some 500 m are rounded to 3e-5 m.
    CHECK(bounded.largest_residual <= kResidualMost * (1.0 + 1e-4));
    CHECK(bounded.largest_residual > 0.99 * kResidualMost);
    CHECK(bounded.num_touched > 100);
    // It leads the filter away, far beyond what noise does.
    CHECK(bounded.last_error_m > 3.0 * run_stealth("{value: [0, 0]}", "", run).last_error_m);
    // Without the bound the filter notices.
    const StealthRun open = run_stealth("{value: [30, -10]}", "", run);
    CHECK(open.num_exceeding > 5);
    CHECK(open.largest_residual > 2.0 * kResidualMost);
  }
}

TEST_CASE("what the filter would not notice anyway is added as it stands") {
  const StealthRun free = run_stealth("{value: 0.001}", ", stealth: {residual_most: 1000}", 0);
  const StealthRun plain = run_stealth("{value: 0.001}", "", 0);
  CHECK(free.num_touched == 181);
  CHECK(free.largest_added_m == plain.largest_added_m);
  CHECK(free.last_error_m == plain.last_error_m);
}

TEST_CASE("where the reading alone exceeds the bound, nothing is added") {
  const StealthRun none = run_stealth("{value: 30}", ", stealth: {residual_most: 0}", 0);
  CHECK(none.num_touched == 0);
}

TEST_CASE("stealth where there is nothing to run a filter on is refused") {
  const std::string rule =
      "attacks=[{name: push, match: {messages: [Sensor01]}, action: add, signal: DETECT, value: "
      "{value: 1}, stealth: {residual_most: 2}}]";
  CHECK(testing::problems_of("binary_tracking", {rule}).find("vector readings") !=
        std::string::npos);
  const std::string counter =
      "attacks=[{name: push, match: {messages: [Position]}, action: add, signal: STEP, value: "
      "{value: 1}, stealth: {residual_most: 2}}]";
  CHECK(testing::problems_of("turning_target", {counter}).find("none of network.signals") !=
        std::string::npos);
  const std::string other =
      "attacks=[{name: push, match: {messages: [PositionScaled]}, action: add, signal: X, value: "
      "{value: 1}, stealth: {residual_most: 2}}]";
  CHECK(testing::problems_of("turning_target", {other}).find("none of network.messages") !=
        std::string::npos);
  const std::string substitute =
      "attacks=[{name: push, match: {messages: [Position]}, action: substitute, signal: X, value: "
      "{value: 1}, stealth: {residual_most: 2}}]";
  CHECK(testing::problems_of("turning_target", {substitute}).find("stealth") != std::string::npos);
}

}  // namespace holdfast
