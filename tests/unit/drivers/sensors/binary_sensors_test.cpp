// The list of sensors as a scenario states it.
#include "drivers/sensors/binary_sensors.h"

#include "tests/support/catch.h"

namespace holdfast {
namespace {

BinarySensors read(const std::string& yaml) {
  static const Dbc dbc = parse_dbc(
      "VERSION \"\"\nBU_: V\nBO_ 256 Level: 1 V\n SG_ HIGH : 0|1@1+ (1,0) [0|1] \"\" V\n"
      " SG_ LOW : 1|1@1- (1,0) [0|1] \"\" V\n SG_ WIDE : 0|2@1+ (1,0) [0|3] \"\" V\n"
      "BO_ 385 Inputs: 1 V\n SG_ ALL : 0|8@1+ (1,0) [0|255] \"\" V\n"
      "BO_ 304 Mux: 2 V\n SG_ WHICH M : 0|8@1+ (1,0) [0|255] \"\" V\n"
      " SG_ A m1 : 8|1@1+ (1,0) [0|1] \"\" V\n SG_ B m2 : 8|1@1+ (1,0) [0|1] \"\" V\n"
      "BO_ 305 Nested: 2 V\n SG_ PAGE M : 0|4@1+ (1,0) [0|15] \"\" V\n"
      " SG_ PART m1M : 4|2@1+ (1,0) [0|3] \"\" V\n SG_ A m2 : 8|1@1+ (1,0) [0|1] \"\" V\n"
      " SG_ B m3 : 8|1@1+ (1,0) [0|1] \"\" V\n SG_ C m2 : 8|1@1+ (1,0) [0|1] \"\" V\n"
      " SG_ D m0 : 8|1@1+ (1,0) [0|1] \"\" V\n SG_ FAR m9 : 9|1@1+ (1,0) [0|1] \"\" V\n"
      "SG_MUL_VAL_ 305 A PART 2-2;\nSG_MUL_VAL_ 305 B PART 3-3;\nSG_MUL_VAL_ 305 C PART 2-3;\n"
      "SG_MUL_VAL_ 305 FAR PART 9-9;\n");
  ConfigurationDocument document = ConfigurationDocument::from_text(yaml, "t");
  BinarySensors sensors;
  ConfigurationMap root = document.root();
  sensors.read(root, dbc);
  document.finish();
  return sensors;
}

std::string problem_of(const std::string& yaml) {
  try {
    read(yaml);
  } catch (const ConfigurationError& error) {
    return error.what();
  }
  return "";
}

bool says(const std::string& yaml, const std::string& part) {
  const std::string text = problem_of(yaml);
  UNSCOPED_INFO(text);
  return text.find(part) != std::string::npos;
}

}  // namespace

TEST_CASE("sensors of three protocols stand in one list, with names by what they are") {
  const BinarySensors sensors = read(
      "sensors:\n"
      "  - {canopen: {node: 5, input: 64}, invert: true}\n"
      "  - {j1939: {pgn: 127501, source: 33, instance: 0, item: 28}}\n"
      "  - {j1939: {pgn: 65241, source: 0x21, start_bit: 6}, name: brake}\n"
      "  - {dbc: {message: Level, signal: HIGH}}\n"
      "sensor_options: {timeout_steps: 5, outages: [{sensor: brake, first_step: 3, last_step: "
      "7}]}");
  REQUIRE(sensors.list.size() == 4);
  CHECK(sensors.list[0].is_inverted);
  CHECK(sensors.list[0].name == "node 5 input 64");
  CHECK(sensors.list[1].start_bit == 62);
  CHECK(sensors.list[2].name == "brake");
  CHECK(sensors.list[2].source_address == 33);
  CHECK(sensors.list[3].name == "Level.HIGH");
  CHECK(sensors.timeout_steps == 5);
  CHECK(sensors.outages.at(0).last_step == 7);
  CHECK(sensors.have_way_back());
  CHECK_FALSE(read("sensors: [{canopen: {node: 5, input: 1}}]\nsensor_options: {starts_nodes: "
                   "false}")
                  .have_way_back());
  CHECK_FALSE(read("sensors: [{dbc: {message: Level, signal: HIGH}}]").have_way_back());
}

TEST_CASE("what no sensor can be is told") {
  CHECK(says("sensors: []", "at least one sensor"));
  CHECK(says("sensors: [{name: x}]", "one of: canopen, j1939, dbc"));
  CHECK(says("sensors: [{canopen: {node: 1, input: 1}, dbc: {message: Level, signal: HIGH}}]",
             "one of"));
  CHECK(says("sensors: [{canopen: {node: 128, input: 1}}]", "node"));
  CHECK(says("sensors: [{canopen: {node: 1, input: 65}}]", "input"));
  CHECK(says("sensors: [{canopen: {node: 1, input: 1}}, {canopen: {node: 1, input: 1}, name: b}]",
             "shares bits"));
  CHECK(says("sensors: [{canopen: {node: 1, input: 1}}, {canopen: {node: 1, input: 1}}]",
             "is taken"));
  CHECK(says("sensors: [{j1939: {pgn: 65241, source: 1, item: 2}}]", "127501"));
  CHECK(says("sensors: [{j1939: {pgn: 65241, source: 1}}]", "item"));
  CHECK(says("sensors: [{j1939: {pgn: 59905, source: 1, start_bit: 0}}]", "ends in 00"));
  CHECK(says("sensors: [{j1939: {pgn: 65241, source: 1, start_bit: 2, instance: 0}}]", "byte 0"));
  CHECK(
      says("sensors: [{j1939: {pgn: 65241, source: 1, start_bit: 2}}, {j1939: {pgn: 65241, "
           "source: 1, start_bit: 3}}]",
           "shares bits"));
  CHECK(says("sensors: [{dbc: {message: Nobody, signal: HIGH}}]", "no message"));
  CHECK(says("sensors: [{dbc: {message: Level, signal: NONE}}]", "no signal"));
  CHECK(says("sensors: [{dbc: {message: Level, signal: LOW}}]", "unsigned"));
  CHECK(
      says("sensors: [{j1939: {pgn: 127501, source: 1, instance: 0, item: 2}}, {j1939: {pgn: "
           "127501, source: 1, item: 9}}]",
           "say it for both"));
  CHECK(says("sensors: [{dbc: {message: Inputs, signal: ALL}}, {canopen: {node: 1, input: 3}}]",
             "another protocol"));
  CHECK(
      says("sensors: [{dbc: {message: Level, signal: WIDE}}, {dbc: {message: Level, signal: "
           "HIGH}}]",
           "shares bits"));
  CHECK(problem_of(
            "sensors: [{dbc: {message: Mux, signal: A}}, {dbc: {message: Mux, signal: B}}]") == "");
  // Signals of one place may share bits only when no frame carries both.
  const auto of_nested = [](const std::string& signal) {
    return "{dbc: {message: Nested, signal: " + signal + "}}";
  };
  const auto pair = [&](const std::string& one, const std::string& other) {
    return "sensors: [" + of_nested(one) + ", " + of_nested(other) + "]";
  };
  CHECK(problem_of(pair("A", "B")) == "");
  CHECK(problem_of(pair("D", "C")) == "");
  CHECK(says(pair("A", "C"), "shares bits"));
  CHECK(says(pair("C", "B"), "shares bits"));
  CHECK(says("sensors: [" + of_nested("FAR") + "]", "no frame of message 'Nested' carries 'FAR'"));
  const std::string one = "sensors: [{canopen: {node: 1, input: 1}, name: a}]\nsensor_options: ";
  CHECK(says(one + "{outages: [{sensor: b}]}", "no sensor is named 'b'"));
  CHECK(says(one + "{outages: [{sensor: a, first_step: 5, last_step: 4}]}", "before first_step"));
  CHECK(says(one + "{heartbeat_steps: 9}", "every node would be silent"));
  CHECK(says(one + "{heartbeat_steps: 0}", "no sign of life"));
  CHECK(says(one + "{typo: 1}", "typo"));
  CHECK(problem_of(one + "{heartbeat_steps: 0, guards_nodes: true}") == "");
}

TEST_CASE("sensors of a Modbus unit stand in one frame, two bits each, in their order") {
  const BinarySensors sensors = read(
      "sensors:\n"
      "  - {modbus: {unit: 3, input: 20}}\n"
      "  - {modbus: {unit: 4, input: 0}, name: a}\n"
      "  - {modbus: {unit: 3, input: 7}, invert: true}\n"
      "sensor_options: {modbus_identifier: 0x200, modbus_timeout_s: 0.5}");
  REQUIRE(sensors.list.size() == 3);
  CHECK(sensors.list[0].name == "unit 3 input 20");
  CHECK(sensors.list[0].identifier == 0x203);
  CHECK(sensors.list[0].start_bit == 0);
  CHECK(sensors.list[1].identifier == 0x204);
  CHECK(sensors.list[1].start_bit == 0);
  CHECK(sensors.list[2].start_bit == 2);
  CHECK(sensors.modbus_timeout_s == 0.5);
  CHECK(sensors.have_units());
  CHECK_FALSE(sensors.have_way_back());
  CHECK(says("sensors: [{modbus: {unit: 3, input: 7}}, {modbus: {unit: 3, input: 7}, name: b}]",
             "reads the input of another sensor"));
  CHECK(says("sensors: [{modbus: {unit: 0, input: 7}}]", "unit"));
  CHECK(says("sensors: [{modbus: {unit: 3}}]", "input"));
  // A message of the DBC, or a node's inputs, cannot be the gateway's frame as well.
  CHECK(
      says("sensors: [{modbus: {unit: 129, input: 0}}, {canopen: {node: 1, input: 1}}]\n"
           "sensor_options: {modbus_identifier: 0x100}",
           "another protocol's sensor"));
  // Nor what a node says it lives, or is ill, by.
  for (const char* base : {"0x80", "0x700"}) {
    CHECK(says(std::string("sensors: [{modbus: {unit: 1, input: 0}}, {canopen: {node: 1, input: "
                           "1}}]\nsensor_options: {modbus_identifier: ") +
                   base + "}",
               "another protocol's sensor"));
  }
  CHECK(problem_of("sensors: [{modbus: {unit: 2, input: 0}}, {canopen: {node: 1, input: 1}}]\n"
                   "sensor_options: {modbus_identifier: 0x80}") == "");
  std::string many = "sensors:\n";
  for (int i = 0; i < 33; ++i)
    many += "  - {modbus: {unit: 3, input: " + std::to_string(i) + "}}\n";
  CHECK(says(many, "at most 32 sensors"));
}

}  // namespace holdfast
