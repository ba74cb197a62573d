#include "tools/simulation.h"

#include "tests/support/catch.h"
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

}  // namespace holdfast
