#include "tools/campaign.h"

#include <cmath>

#include "tests/support/catch.h"
#include "tools/simulation.h"

namespace holdfast {
namespace {

Experiment small(std::vector<std::string> overrides = {}) {
  overrides.insert(overrides.begin(),
                   {"steps=15", "estimators.secure.particles=100",
                    "estimators.neglect.particles=100", "estimators.uncorrupted.particles=100"});
  return load_experiment(std::string(HOLDFAST_SOURCE_DIR) + "/scenarios/binary_tracking.yaml",
                         overrides);
}

CampaignResult run(const Experiment& experiment, int num_threads, std::int64_t first_run = 0) {
  CampaignOptions options;
  options.num_runs = 12;
  options.first_run = first_run;
  options.num_threads = num_threads;
  return run_campaign(experiment, options);
}

}  // namespace

TEST_CASE("a campaign gives the same bits on any number of threads") {
  const Experiment experiment = small();
  const CampaignResult one = run(experiment, 1), three = run(experiment, 3);
  REQUIRE(one.errors.size() == 6);
  for (std::size_t i = 0; i < one.errors.size(); ++i) {
    CHECK(one.errors[i].rmse_over_runs == three.errors[i].rmse_over_runs);
    CHECK(one.errors[i].rmse_step_mean == three.errors[i].rmse_step_mean);
    CHECK(one.errors[i].standard_error == three.errors[i].standard_error);
  }
  // Negative control: other runs are other numbers.
  CHECK(run(experiment, 1, 100).errors[0].rmse_step_mean != one.errors[0].rmse_step_mean);
}

TEST_CASE("a campaign's curve is the root mean square over runs, done by hand") {
  const Experiment experiment = small();
  const CampaignResult result = run(experiment, 2);
  std::vector<double> sum(15, 0.0);
  for (std::uint32_t r = 0; r < 12; ++r) {
    Simulation simulation(experiment, r);
    for (std::size_t k = 0; simulation.advance(); ++k) {
      const Eigen::VectorXd error = simulation.estimates()[0]->mean - simulation.truth().state;
      sum[k] += error[0] * error[0] + error[2] * error[2];
    }
  }
  CHECK(result.errors[0].group == "position");
  for (std::size_t k = 0; k < sum.size(); ++k) {
    CHECK(result.errors[0].rmse_over_runs[k] == Approx(std::sqrt(sum[k] / 12.0)).epsilon(1e-12));
  }
}

TEST_CASE("progress counts every run once") {
  CampaignOptions options;
  options.num_runs = 7;
  options.num_threads = 3;
  std::vector<std::int64_t> seen;
  options.on_progress = [&seen](std::int64_t done, std::int64_t) { seen.push_back(done); };
  run_campaign(small(), options);
  std::sort(seen.begin(), seen.end());
  CHECK(seen == std::vector<std::int64_t>{1, 2, 3, 4, 5, 6, 7});
}

TEST_CASE("what throws in a run comes out of the campaign") {
  Experiment experiment = small();
  experiment.estimators[0].particle_filter.kernel = "no such kernel";
  CHECK_THROWS_AS(run(experiment, 2), UsageError);
}

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

TEST_CASE("a campaign that would not fit into memory is refused with what to do") {
  CampaignOptions options;
  options.num_runs = 1'000'000'000;
  CHECK_THROWS_AS(run_campaign(small(), options), UsageError);
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

}  // namespace holdfast
