// Simulated sensors and a driver that listens to them: what they see arrives, or is missing with a
// reason.
#include "drivers/sensors/sensor_states.h"

#include <algorithm>
#include <map>

#include "tests/support/catch.h"
#include "tests/unit/drivers/sensors/random_readings.h"

namespace holdfast {
namespace {

const Dbc& doors() {
  static const Dbc dbc = parse_dbc(
      "VERSION \"\"\nBU_: V\nBO_ 256 Doors: 1 V\n SG_ FRONT : 0|1@1+ (1,0) [0|1] \"\" V\n"
      " SG_ REAR : 1|1@1+ (1,0) [0|1] \"\" V\n");
  return dbc;
}

BinarySensors mixed(const std::string& options) {
  ConfigurationDocument document = ConfigurationDocument::from_text(
      "sensors:\n"
      "  - {canopen: {node: 5, input: 3}, name: a}\n"
      "  - {j1939: {pgn: 127501, source: 33, instance: 0, item: 4}, name: b, invert: true}\n"
      "  - {dbc: {message: Doors, signal: REAR}, name: c}\n"
      "  - {canopen: {node: 5, input: 12}, name: d, invert: true}\n"
      "  - {canopen: {node: 7, input: 1}, name: e}\n"
      "  - {dbc: {message: Doors, signal: FRONT}, name: f}\n"
      "sensor_options: " +
          options,
      "t");
  BinarySensors sensors;
  ConfigurationMap root = document.root();
  sensors.read(root, doors());
  document.finish();
  return sensors;
}

struct Bench {
  explicit Bench(const BinarySensors& sensors)
      : twins(sensors, doors()), states(sensors, doors()) {}

  // One step; what the sensors are told comes before the next one.
  MeasurementSet step(const std::vector<std::vector<double>>& readings) {
    ++number;
    frames.clear();
    twins.step(number, readings, frames);
    for (const CanFrame& frame : frames)
      CHECK(states.on_frame(frame, rx_index++, number) == SensorStates::Taken::kTaken);
    MeasurementSet set;
    states.sample(number, set);
    asked.clear();
    states.ask(number, asked);
    for (const CanFrame& frame : asked) twins.on_frame(frame);
    return set;
  }

  SensorTwins twins;
  SensorStates states;
  std::vector<CanFrame> frames, asked;
  std::int64_t number = 0, rx_index = 0;
};

std::vector<std::vector<double>> readings_of(std::int64_t step) {
  return testing::random_readings(6, step);
}

std::map<int, double> values_of(const MeasurementSet& set) {
  std::map<int, double> values;
  for (const Packet& packet : set.packets) values[packet.source] = set.values_of(packet)[0];
  return values;
}

std::map<int, InvalidReason> reasons_of(const MeasurementSet& set) {
  std::map<int, InvalidReason> reasons;
  for (const InvalidReading& invalid : set.invalid) reasons[invalid.source] = invalid.reason;
  return reasons;
}

}  // namespace

TEST_CASE("what sensors of three protocols see, a driver knows in the same step, in their order") {
  Bench bench(mixed("{}"));
  for (std::int64_t step = 1; step <= 200; ++step) {
    const auto readings = readings_of(step);
    const MeasurementSet set = bench.step(readings);
    CHECK(set.invalid.empty());
    REQUIRE(set.packets.size() == 6);
    for (std::size_t i = 0; i < 6; ++i) {
      CHECK(set.packets[i].source == static_cast<int>(i));
      CHECK(set.values_of(set.packets[i])[0] == readings[i][0]);
      CHECK(set.packets[i].rx_index >= 0);
    }
    CHECK(bench.asked.empty());
  }
}

TEST_CASE("a sensor that is pulled out is missing until it is back, with all on its device") {
  Bench bench(
      mixed("{timeout_steps: 2, outages: [{sensor: d, first_step: 5, last_step: 9}, {sensor: c, "
            "first_step: 7, last_step: 7}, {sensor: b, first_step: 3, last_step: 30}]}"));
  for (std::int64_t step = 1; step <= 20; ++step) {
    const auto readings = readings_of(step);
    const MeasurementSet set = bench.step(readings);
    const auto reasons = reasons_of(set);
    std::map<int, InvalidReason> expected;
    // Silent for two steps: known in the first of them, as it was.
    if (step >= 6 && step <= 9) expected[0] = expected[3] = InvalidReason::kSilent;
    if (step >= 4) expected[1] = InvalidReason::kSilent;
    CHECK(reasons == expected);
    for (const auto& [source, value] : values_of(set)) {
      const bool is_old = ((source == 0 || source == 3) && step == 5) ||
                          ((source == 2 || source == 5) && step == 7) || (source == 1 && step == 3);
      const auto at = is_old ? readings_of(step - 1) : readings;
      CHECK(value == at[static_cast<std::size_t>(source)][0]);
    }
  }
}

TEST_CASE("nodes that wait for a start are started, and heard from the next step on") {
  Bench bench(mixed("{nodes_start_themselves: false}"));
  CHECK(reasons_of(bench.step(readings_of(1))) ==
        std::map<int, InvalidReason>{{0, InvalidReason::kNotOperational},
                                     {3, InvalidReason::kNotOperational},
                                     {4, InvalidReason::kNotOperational}});
  CHECK(bench.asked.size() == 2);
  CHECK(bench.step(readings_of(2)).packets.size() == 6);
  CHECK(bench.asked.empty());
  Bench alone(mixed("{nodes_start_themselves: false, starts_nodes: false}"));
  for (std::int64_t step = 1; step <= 5; ++step)
    CHECK(alone.step(readings_of(step)).packets.size() == 3);
}

TEST_CASE("guarded nodes need no heartbeat") {
  Bench bench(mixed("{heartbeat_steps: 0, guards_nodes: true, timeout_steps: 2}"));
  bench.step(readings_of(1));
  CHECK(bench.asked.size() ==
        4);  // both are asked, and started, since only their boot-up was heard
  for (std::int64_t step = 2; step <= 20; ++step) {
    CHECK(bench.step(readings_of(step)).packets.size() == 6);
    CHECK(bench.asked.size() == 2);
  }
}

TEST_CASE("frames that are none of the sensors' are told apart from broken ones") {
  SensorStates states(mixed("{}"), doors());
  CanFrame stranger;
  stranger.identifier = 0x333;
  CHECK(states.on_frame(stranger, 0, 1) == SensorStates::Taken::kUnknown);
  CHECK(states.on_frame(canopen_frame(0x705, {1, 2, 3}), 0, 1) ==
        SensorStates::Taken::kWrongFormat);
  MeasurementSet set;
  states.sample(1, set);
  CHECK(set.invalid.size() == 6);
  CHECK(std::ranges::all_of(set.invalid, [](const InvalidReading& invalid) {
    return invalid.reason == InvalidReason::kNeverHeard;
  }));
  const BinarySensors sensors = mixed("{}");
  CHECK(is_for_sensors(sensors, canopen_frame(0x000, {0x01, 0x05})));
  CHECK(is_for_sensors(sensors, CanopenRemote(5).guard_request()));
  CHECK_FALSE(is_for_sensors(sensors, canopen_frame(0x000, {0x01})));
  CHECK_FALSE(is_for_sensors(sensors, canopen_frame(0x185, {0x01, 0x05})));
}

}  // namespace holdfast
