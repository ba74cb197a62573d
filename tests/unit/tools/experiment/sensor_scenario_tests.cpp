// The same plant, its sensors speaking other protocols: where the information is the same, so is
// the estimate.
#include <map>

#include "tests/support/catch.h"
#include "tests/unit/tools/experiment/scenario_texts.h"
#include "tools/simulation.h"

namespace holdfast {
namespace {

constexpr int kNumSensors = 16;
const std::string kSensorSteps = "steps=60";
const std::string kSensorEstimators =
    "estimators=[{name: secure, method: secure_particle_filter, particles: 200, assumes: {dos: "
    "same, deception: same, flip: 0}}, {name: clean, method: secure_particle_filter, particles: "
    "100, input: clean, assumes: {dos: 0, deception: 0, flip: 0}}]";

std::string network_of(const std::vector<std::string>& sensors, const std::string& options) {
  std::string list;
  for (const std::string& sensor : sensors) list += (list.empty() ? "" : ", ") + sensor;
  return "network={sensor_bus: auto, monitor_bus: auto, dbc: binary_sensors.dbc, tick: {message: "
         "StepTick, signal: STEP}, sensors: [" +
         list + "], sensor_options: " + options + "}";
}

std::vector<std::string> canopen_sensors() {
  std::vector<std::string> sensors;
  for (int i = 0; i < kNumSensors; ++i)
    sensors.push_back("{canopen: {node: " + std::to_string(1 + i / 8) +
                      ", input: " + std::to_string(1 + i % 8) + "}, name: s" + std::to_string(i) +
                      (i % 3 == 0 ? ", invert: true}" : "}"));
  return sensors;
}

std::vector<std::string> j1939_sensors() {
  std::vector<std::string> sensors;
  for (int i = 0; i < kNumSensors; ++i)
    sensors.push_back("{j1939: {pgn: 127501, source: " + std::to_string(40 + i / 10) +
                      ", instance: " + std::to_string(i / 5) + ", item: " +
                      std::to_string(1 + i % 5) + "}, name: s" + std::to_string(i) + "}");
  return sensors;
}

// Any instance, and bits in place of items.
std::vector<std::string> two_bit_sensors() {
  std::vector<std::string> sensors;
  for (int i = 0; i < kNumSensors; ++i)
    sensors.push_back("{j1939: {pgn: 65241, source: 33, start_bit: " + std::to_string(2 * i) +
                      "}}");
  return sensors;
}

std::vector<std::string> dbc_sensors() {
  std::vector<std::string> sensors;
  for (int i = 1; i <= kNumSensors; ++i)
    sensors.push_back("{dbc: {message: Sensor" + std::string(i < 10 ? "0" : "") +
                      std::to_string(i) + ", signal: DETECT}}");
  return sensors;
}

struct SensorRun {
  std::vector<Eigen::VectorXd> means;  // of both estimators, step by step
  std::vector<std::size_t> num_packets;
  std::map<InvalidReason, int> invalid;
};

SensorRun run_sensors(const std::vector<std::string>& overrides,
                      const std::string& attacks = "attacks=[]") {
  std::vector<std::string> all = {kSensorSteps, kSensorEstimators, attacks};
  all.insert(all.end(), overrides.begin(), overrides.end());
  const Experiment experiment = load_experiment(testing::scenario("binary_tracking"), all);
  // What a log holds reads back as it was.
  experiment_from_text(experiment.resolved, "resolved");
  Simulation simulation(experiment, 0);
  SensorRun played;
  while (simulation.advance()) {
    for (const Estimate* estimate : simulation.estimates()) played.means.push_back(estimate->mean);
    played.num_packets.push_back(simulation.measurements().packets.size());
    for (const InvalidReading& reading : simulation.measurements().invalid)
      ++played.invalid[reading.reason];
  }
  return played;
}

bool are_equal_runs(const SensorRun& a, const SensorRun& b) {
  return a.num_packets == b.num_packets && a.means.size() == b.means.size() &&
         std::equal(a.means.begin(), a.means.end(), b.means.begin());
}

}  // namespace

TEST_CASE(
    "CANopen, NMEA 2000 and a DBC's signals give the estimate of a message for each reading") {
  const SensorRun plain = run_sensors({});
  REQUIRE(plain.means.size() == 120);
  CHECK(are_equal_runs(run_sensors({network_of(canopen_sensors(), "{}")}), plain));
  CHECK(are_equal_runs(run_sensors({network_of(j1939_sensors(), "{}")}), plain));
  CHECK(are_equal_runs(run_sensors({network_of(two_bit_sensors(), "{}")}), plain));
  CHECK(are_equal_runs(run_sensors({network_of(dbc_sensors(), "{}")}), plain));
  // Control: a sensor that is missing for a while makes another estimate.
  CHECK_FALSE(are_equal_runs(
      run_sensors(
          {network_of(j1939_sensors(), "{outages: [{sensor: s0, first_step: 9, last_step: 19}]}")}),
      plain));
}

TEST_CASE("a node that is pulled out is, for an estimator, messages that do not arrive") {
  const std::string loss =
      "attacks=[{name: lost, match: {messages: [Sensor09, Sensor10, Sensor11, Sensor12, Sensor13, "
      "Sensor14, Sensor15, Sensor16]}, window: {first_step: 20, last_step: 30}, action: drop}]";
  const SensorRun dropped = run_sensors({}, loss);
  const SensorRun pulled = run_sensors(
      {network_of(canopen_sensors(),
                  "{timeout_steps: 1, outages: [{sensor: s8, first_step: 20, last_step: 30}]}")});
  // The clean route has no attack, but its sensors are pulled out as well.
  CHECK(pulled.num_packets == dropped.num_packets);
  for (std::size_t i = 0; i < pulled.means.size(); i += 2)
    CHECK(pulled.means[i] == dropped.means[i]);
  CHECK(pulled.invalid == std::map<InvalidReason, int>{{InvalidReason::kSilent, 88}});
  CHECK_FALSE(are_equal_runs(pulled, run_sensors({})));
}

TEST_CASE(
    "rules act on the frames that sensors send, and a forged heartbeat keeps a dead one alive") {
  std::string network = network_of(canopen_sensors(), "{timeout_steps: 1}");
  network.replace(network.find("binary_sensors.dbc"), 18, "canopen_inputs.dbc");
  const std::string silence =
      "{name: silence, match: {messages: [Inputs1, Life1]}, window: {first_step: 10, last_step: "
      "19}, action: drop}";
  const SensorRun silent = run_sensors({network}, "attacks=[" + silence + "]");
  CHECK(silent.invalid.at(InvalidReason::kSilent) == 80);
  const SensorRun masked = run_sensors(
      {network}, "attacks=[" + silence +
                     ", {name: alive, match: {messages: [Life1]}, window: {first_step: 10, "
                     "last_step: 19}, action: inject, signal: STATE, value: {value: 5}}]");
  // The estimator is given what the node said last, and nobody knows.
  CHECK(masked.invalid.empty());
  CHECK(masked.num_packets == std::vector<std::size_t>(60, 16));
  CHECK_FALSE(are_equal_runs(masked, run_sensors({network})));
}

TEST_CASE("a state that rests on a forged frame is not authentic, however old the frame") {
  std::string network = network_of(canopen_sensors(), "{repeat_steps: 1000}");
  network.replace(network.find("binary_sensors.dbc"), 18, "canopen_inputs.dbc");
  const Experiment experiment = load_experiment(
      testing::scenario("binary_tracking"),
      {kSensorSteps, kSensorEstimators, network,
       "attacks=[{name: forge, match: {messages: [Inputs1]}, times: 1, action: substitute, signal: "
       "INPUTS, value: {value: 255}}, {name: hold, match: {messages: [Inputs1]}, unless: forge, "
       "action: drop}]"});
  Simulation simulation(experiment, 0);
  while (simulation.advance()) CHECK(simulation.num_authentic() == 8);  // those of node 2
}

TEST_CASE("sensors where messages stand, or of a plant with vector readings, are refused") {
  const auto problem = [](const std::string& name, const std::vector<std::string>& overrides) {
    return testing::problems_of(name, overrides);
  };
  CHECK(problem("binary_tracking", {"network.sensors=[{canopen: {node: 1, input: 1}}]"})
            .find("give either") != std::string::npos);
  std::vector<std::string> few = canopen_sensors();
  few.pop_back();
  CHECK(problem("binary_tracking", {network_of(few, "{}")})
            .find("15 sensors for the 16 of the plant") != std::string::npos);
  std::vector<std::string> with_tick = dbc_sensors();
  with_tick[3] = "{dbc: {message: StepTick, signal: STEP}}";
  CHECK(problem("binary_tracking", {network_of(with_tick, "{}")})
            .find("identifier of message 'StepTick'") != std::string::npos);
  CHECK(problem("turning_target",
                {"network={sensor_bus: auto, monitor_bus: auto, dbc: turning_target.dbc, tick: "
                 "{message: StepTick, signal: STEP}, sensors: [{canopen: {node: 1, input: 1}}]}",
                 "attacks=[]"})
            .find("are binary") != std::string::npos);
}

}  // namespace holdfast
