// What a gateway asks Modbus units for, what it tells of them, and the units that answer.
#include "drivers/sensors/modbus_units.h"

#include <algorithm>
#include <string>

#include "common/random_stream.h"
#include "drivers/sensors/sensor_states.h"
#include "tests/support/catch.h"
#include "tests/unit/drivers/sensors/random_readings.h"

namespace holdfast {
namespace {

BinarySensors units_of(const std::string& options = "{}") {
  ConfigurationDocument document = ConfigurationDocument::from_text(
      "sensors:\n"
      "  - {modbus: {unit: 3, input: 20}}\n"
      "  - {modbus: {unit: 7, input: 0}}\n"
      "  - {modbus: {unit: 3, input: 7}, invert: true}\n"
      "  - {modbus: {unit: 3, input: 21}}\n"
      "  - {modbus: {unit: 3, input: 8}}\n"
      "sensor_options: " +
          options,
      "t");
  BinarySensors sensors;
  ConfigurationMap root = document.root();
  sensors.read(root, {});
  document.finish();
  return sensors;
}

std::vector<std::vector<double>> bits_of(std::int64_t step) {
  return testing::random_readings(5, step);
}

CanFrame frame_of(const ModbusUnit& unit) {
  std::vector<CanFrame> frames;
  unit.tell(frames);
  REQUIRE(frames.size() == 1);
  return frames[0];
}

// What came of one step: the first unit's answers over a line that never fails, as the driver's
// set.
struct Chain {
  explicit Chain(const BinarySensors& sensors, bool is_in_step)
      : simulated(sensors, {}),
        units(modbus_units(sensors)),
        states(sensors, {}),
        serving{{sensors, 3, is_in_step}, {sensors, 7, is_in_step}} {}

  void plant_step() {
    frames.clear();
    ++num_steps;
    simulated.step(num_steps, bits_of(num_steps), frames);
    for (ModbusTwin& twin : serving) {
      for (const CanFrame& frame : frames) twin.on_frame(frame);
      twin.end_step();
    }
  }
  MeasurementSet round() {
    frames.clear();
    for (std::size_t u = 0; u < units.size(); ++u) {
      for (const ModbusRequest& request : units[u].requests()) {
        std::vector<std::uint8_t> inputs(request.places.size());
        const ModbusTwin::Reply reply = serving[u].on_request(request.first_input);
        REQUIRE(reply != ModbusTwin::Reply::kNotYet);
        const auto first = static_cast<std::size_t>(request.first_input - serving[u].first_input());
        std::ranges::copy(serving[u].inputs().subspan(first, inputs.size()), inputs.begin());
        units[u].take(
            request,
            reply == ModbusTwin::Reply::kAnswer ? ModbusAnswer::kInputs : ModbusAnswer::kSilent,
            inputs);
      }
      units[u].tell(frames);
    }
    ++num_rounds;
    for (const CanFrame& frame : frames)
      CHECK(states.on_frame(frame, 0, num_rounds) == SensorStates::Taken::kTaken);
    MeasurementSet set;
    states.sample(num_rounds, set);
    return set;
  }

  SensorTwins simulated;
  std::vector<ModbusUnit> units;
  SensorStates states;
  std::vector<ModbusTwin> serving;
  std::vector<CanFrame> frames;
  std::int64_t num_steps = 0, num_rounds = 0;
};

}  // namespace

TEST_CASE("addresses that follow each other are asked for at once, and no others") {
  const std::vector<ModbusUnit> units = modbus_units(units_of());
  REQUIRE(units.size() == 2);
  CHECK(units[0].unit() == 3);
  REQUIRE(units[0].requests().size() == 2);
  CHECK(units[0].requests()[0].first_input == 7);
  CHECK(units[0].requests()[0].places == std::vector<std::size_t>{1, 3});
  CHECK(units[0].requests()[1].first_input == 20);
  CHECK(units[0].requests()[1].places == std::vector<std::size_t>{0, 2});
  CHECK(units[1].unit() == 7);
}

TEST_CASE("what came of a request stands in the unit's frame") {
  ModbusUnit unit = modbus_units(units_of())[0];
  CHECK(frame_of(unit).identifier == 0x503);
  CHECK(frame_of(unit).num_bytes == 8);
  CHECK(frame_of(unit).data[0] == 0xFF);  // nobody was asked
  const std::vector<std::uint8_t> inputs = {1, 0};
  unit.take(unit.requests()[0], ModbusAnswer::kInputs, inputs);
  CHECK(frame_of(unit).data[0] == 0b00'11'01'11);
  unit.take(unit.requests()[1], ModbusAnswer::kException, {});
  CHECK(frame_of(unit).data[0] == 0b00'10'01'10);
  unit.take(unit.requests()[0], ModbusAnswer::kBroken, {});
  CHECK(frame_of(unit).data[0] == 0b10'10'10'10);
  unit.take(unit.requests()[1], ModbusAnswer::kLineGone, {});
  CHECK(frame_of(unit).data[0] == 0b10'11'10'11);
  CHECK(frame_of(unit).data[1] == 0xFF);
}

TEST_CASE("units in step tell each step once, however far behind the gateway asks") {
  Chain chain(units_of("{outages: [{sensor: unit 3 input 8, first_step: 4, last_step: 6}]}"), true);
  const RandomStream stream(6, 0, "test/lag");
  for (std::int64_t step = 1; step <= 100; ++step) {
    const bool must_wait = chain.num_steps == chain.num_rounds;
    if (must_wait) CHECK(chain.serving[0].on_request(7) == ModbusTwin::Reply::kNotYet);
    const int ahead = must_wait ? 1 : 0;
    const auto more = static_cast<int>(3 * stream.uniform(static_cast<std::uint32_t>(step), 0));
    for (int i = 0; i < ahead + more; ++i) chain.plant_step();
    const MeasurementSet set = chain.round();
    const auto readings = bits_of(step);
    const bool is_out = step >= 4 && step <= 6;
    CHECK(set.packets.size() == (is_out ? 1 : 5));
    for (const Packet& packet : set.packets)
      CHECK(set.values_of(packet)[0] == readings[static_cast<std::size_t>(packet.source)][0]);
    for (const InvalidReading& invalid : set.invalid)
      CHECK(invalid.reason == InvalidReason::kNotAvailable);
  }
}

TEST_CASE("a unit that is not in step tells the latest, and nothing before there is one") {
  Chain chain(units_of(), false);
  CHECK(chain.round().invalid.size() == 5);
  for (int i = 0; i < 5; ++i) chain.plant_step();
  for (int i = 0; i < 2; ++i) {
    const MeasurementSet set = chain.round();
    REQUIRE(set.packets.size() == 5);
    for (const Packet& packet : set.packets)
      CHECK(set.values_of(packet)[0] == bits_of(5)[static_cast<std::size_t>(packet.source)][0]);
  }
}

TEST_CASE("a unit that is not in step answers a master that asks in an order of its own") {
  const BinarySensors sensors = units_of();
  ModbusTwin twin(sensors, 3, false);
  SensorTwins simulated(sensors, {});
  CHECK(twin.on_request(20) == ModbusTwin::Reply::kSilent);
  std::vector<CanFrame> frames;
  simulated.step(1, {{1}, {1}, {0}, {0}, {0}}, frames);
  for (const CanFrame& frame : frames) twin.on_frame(frame);
  twin.end_step();
  CHECK(twin.on_request(20) == ModbusTwin::Reply::kAnswer);
  CHECK(twin.inputs()[13] == 1);  // address 20
  CHECK(twin.inputs()[0] == 1);   // address 7, inverted
  CHECK(twin.on_request(0) == ModbusTwin::Reply::kAnswer);
}

TEST_CASE("steps that nobody asks for are forgotten at last, and counted") {
  const BinarySensors sensors = units_of();
  ModbusTwin twin(sensors, 7, true);
  for (int i = 0; i < 100'010; ++i) twin.end_step();
  CHECK(twin.num_forgotten() == 10);
}

TEST_CASE("a line's URL says what it means, or what may stand there") {
  const ModbusUrl plain = ModbusUrl::parse("/dev/ttyUSB0");
  CHECK(plain.baud == 19200);
  CHECK(plain.parity == 'E');
  const ModbusUrl full = ModbusUrl::parse("/dev/a@b@9600?parity=none&stop=2");
  CHECK(full.device == "/dev/a@b");
  CHECK(full.baud == 9600);
  CHECK(full.parity == 'N');
  CHECK(full.stop_bits == 2);
  CHECK(full.gap_s() > 0.004);
  CHECK(ModbusUrl::parse("x@115200").gap_s() == 0.00175);
  for (const char* wrong : {"", "@9600", "x@0", "x@fast", "x?parity=mark", "x?stop=3", "x?a=b"})
    CHECK_THROWS_AS(ModbusUrl::parse(wrong), UsageError);
}

}  // namespace holdfast
