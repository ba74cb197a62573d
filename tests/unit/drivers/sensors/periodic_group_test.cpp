// Two-bit states of J1939 and NMEA 2000, and states in a vendor's messages.
#include "drivers/sensors/periodic_group.h"

#include "tests/support/catch.h"

namespace holdfast {
namespace {

BinarySensor switch_item(int item, int instance = 0) {
  BinarySensor sensor;
  sensor.protocol = BinarySensor::Protocol::kJ1939;
  sensor.group_number = 127501;
  sensor.source_address = 0x21;
  sensor.instance = instance;
  sensor.start_bit = 8 + 2 * (item - 1);
  return sensor;
}

CanFrame group_frame(std::uint32_t identifier, std::initializer_list<std::uint8_t> bytes) {
  CanFrame frame;
  frame.identifier = identifier;
  frame.flags = CanFrame::kExtended;
  frame.num_bytes = static_cast<std::uint8_t>(bytes.size());
  std::copy(bytes.begin(), bytes.end(), frame.data.begin());
  return frame;
}

const char* const kDbc = R"dbc(VERSION ""
BU_: Vendor
BO_ 2566848513 Doors: 2 Vendor
 SG_ FRONT : 0|1@1+ (1,0) [0|1] "" Vendor
 SG_ REAR : 3|3@1+ (1,0) [0|7] "" Vendor
BO_ 304 Mux: 2 Vendor
 SG_ WHICH M : 0|8@1+ (1,0) [0|255] "" Vendor
 SG_ A m1 : 8|1@1+ (1,0) [0|1] "" Vendor
 SG_ B m2 : 8|1@1+ (1,0) [0|1] "" Vendor
BO_ 305 Nested: 2 Vendor
 SG_ PAGE M : 0|4@1+ (1,0) [0|15] "" Vendor
 SG_ PART m2M : 4|4@1+ (1,0) [0|15] "" Vendor
 SG_ A m3 : 8|1@1+ (1,0) [0|1] "" Vendor
 SG_ B m3 : 9|1@1+ (1,0) [0|1] "" Vendor
 SG_ C m1 : 8|1@1+ (1,0) [0|1] "" Vendor
 SG_ ALWAYS : 15|1@1+ (1,0) [0|1] "" Vendor
SG_MUL_VAL_ 305 A PART 3-3;
SG_MUL_VAL_ 305 B PART 3-4;
)dbc";

std::vector<CanFrame> encoded(const PeriodicGroup& group, const std::vector<std::uint8_t>& states) {
  std::vector<CanFrame> frames;
  group.encode(states, frames);
  return frames;
}

BinarySensor signal_of(const std::string& message, const std::string& signal) {
  BinarySensor sensor;
  sensor.message = message;
  sensor.signal = signal;
  return sensor;
}

}  // namespace

TEST_CASE("identifiers of parameter groups") {
  // Switch bank status of address 0x21, priority 3; auxiliary state of it, priority 6.
  CHECK(j1939_identifier(127501, 0x21) == 0x0DF20D21);
  CHECK(j1939_identifier(65241, 0x21) == 0x18FED921);
  CHECK(j1939_group_number(0x0DF20D21) == 127501);
  CHECK(j1939_group_number(0x18FED921) == 65241);
  // What is sent to one address has that address in the place of the group's low byte.
  CHECK(j1939_group_number(0x18EAFF21) == 59904);
  CHECK(j1939_group_number(0x18EA0321) == 59904);
  CHECK(j1939_identifier(59904, 0x21) == 0x18EAFF21);
}

TEST_CASE("two bits say 0, 1, faulty or not available, and silence says so") {
  PeriodicGroup group(switch_item(1), {}, 2);
  for (int item = 1; item <= 4; ++item) group.add(switch_item(item));
  CHECK(group.reason(0, 1) == InvalidReason::kNeverHeard);
  // Items 1 to 4 of the first byte: 00, 01, 10, 11.
  const CanFrame frame = group_frame(0x0DF20D21, {0x00, 0xE4, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF});
  REQUIRE(group.is_one(frame));
  REQUIRE(group.on_frame(frame, 5));
  const InvalidReason expected[] = {InvalidReason::kNone, InvalidReason::kNone,
                                    InvalidReason::kError, InvalidReason::kNotAvailable};
  for (std::size_t i = 0; i < 4; ++i) CHECK(group.reason(i, 5) == expected[i]);
  CHECK_FALSE(group.state(0));
  CHECK(group.state(1));
  CHECK(group.reason(0, 6) == InvalidReason::kNone);
  CHECK(group.reason(0, 7) == InvalidReason::kSilent);
}

TEST_CASE("a group is told by number, address and instance, not by priority") {
  PeriodicGroup group(switch_item(1), {});
  group.add(switch_item(28));
  const std::initializer_list<std::uint8_t> bytes = {0, 0, 0, 0, 0, 0, 0, 0x40};
  CHECK(group.is_one(group_frame(0x19F20D21, bytes)));
  CHECK_FALSE(group.is_one(group_frame(0x0DF20D22, bytes)));
  CHECK_FALSE(group.is_one(group_frame(0x0DF20E21, bytes)));
  CHECK_FALSE(group.is_one(group_frame(0x0DF20D21, {1, 0, 0, 0, 0, 0, 0, 0})));
  CHECK_FALSE(group.is_one(CanFrame{}));
  CHECK(PeriodicGroup(switch_item(1, -1), {})
            .is_one(group_frame(0x0DF20D21, {9, 0, 0, 0, 0, 0, 0, 0})));
  // Too short for the last item; of others, too short for some.
  CHECK_FALSE(group.on_frame(group_frame(0x0DF20D21, {0, 0, 0}), 1));
  PeriodicGroup two(switch_item(1), {});
  two.add(switch_item(1));
  two.add(switch_item(5));
  REQUIRE(two.on_frame(group_frame(0x0DF20D21, {0, 0xF1}), 1));
  CHECK(two.reason(0, 1) == InvalidReason::kNone);
  CHECK(two.reason(1, 1) == InvalidReason::kNotAvailable);
  REQUIRE(group.on_frame(group_frame(0x0DF20D21, bytes), 1));
  CHECK(group.state(0));
  CHECK(group.holds(switch_item(7)));
  CHECK_FALSE(group.holds(switch_item(7, 3)));
}

TEST_CASE("what is encoded is decoded, and the rest is not available") {
  PeriodicGroup group(switch_item(2), {});
  group.add(switch_item(2));
  group.add(switch_item(28));
  const CanFrame frame = encoded(group, {true, false}).at(0);
  CHECK(frame.identifier == 0x0DF20D21);
  CHECK(frame.has(CanFrame::kExtended));
  CHECK(frame.data[0] == 0);
  CHECK(frame.data[1] == 0xF7);
  CHECK(frame.data[7] == 0x3F);
  REQUIRE(group.on_frame(frame, 1));
  CHECK(group.state(0));
  CHECK_FALSE(group.state(1));
}

TEST_CASE("signals of a DBC: 0, 1, and wider ones the same four states") {
  const Dbc dbc = parse_dbc(kDbc);
  REQUIRE(dbc.problems.empty());
  PeriodicGroup group(signal_of("Doors", "FRONT"), dbc);
  group.add(signal_of("Doors", "FRONT"));
  group.add(signal_of("Doors", "REAR"));
  CHECK(encoded(group, {true, true}).at(0).data[0] == 0x09);
  const std::uint32_t identifier = 2566848513U & 0x1FFFFFFFU;
  const std::pair<std::uint8_t, InvalidReason> cases[] = {{0, InvalidReason::kNone},
                                                          {1, InvalidReason::kNone},
                                                          {2, InvalidReason::kError},
                                                          {6, InvalidReason::kError},
                                                          {7, InvalidReason::kNotAvailable}};
  for (const auto& [raw, reason] : cases) {
    REQUIRE(
        group.on_frame(group_frame(identifier, {static_cast<std::uint8_t>(1 | raw << 3), 0}), 1));
    CHECK(group.reason(0, 1) == InvalidReason::kNone);
    CHECK(group.state(0));
    CHECK(group.reason(1, 1) == reason);
    CHECK(group.state(1) == (raw == 1));
  }
  CHECK_FALSE(group.on_frame(group_frame(identifier, {1}), 1));
  CHECK_FALSE(group.is_one(group_frame(identifier + 1, {1, 0})));
}

TEST_CASE("a state that the multiplexer does not select stays as it was") {
  const Dbc dbc = parse_dbc(kDbc);
  PeriodicGroup group(signal_of("Mux", "A"), dbc);
  group.add(signal_of("Mux", "A"));
  group.add(signal_of("Mux", "B"));
  const auto frame = [](std::uint8_t which, std::uint8_t value) {
    CanFrame result;
    result.identifier = 304;
    result.num_bytes = 2;
    result.data[0] = which;
    result.data[1] = value;
    return result;
  };
  REQUIRE(group.on_frame(frame(1, 1), 1));
  CHECK(group.reason(0, 1) == InvalidReason::kNone);
  CHECK(group.reason(1, 1) == InvalidReason::kNotAvailable);  // nothing was said of it yet
  REQUIRE(group.on_frame(frame(2, 0), 1));
  CHECK(group.state(0));
  CHECK_FALSE(group.state(1));
  REQUIRE(group.on_frame(frame(2, 1), 2));
  REQUIRE(group.on_frame(frame(1, 0), 2));
  CHECK_FALSE(group.state(0));
  CHECK(group.state(1));
  // After silence each has to be told again.
  REQUIRE(group.on_frame(frame(2, 1), 20));
  CHECK(group.reason(0, 20) == InvalidReason::kNotAvailable);
  CHECK(group.reason(1, 20) == InvalidReason::kNone);
  // Its twin sends one frame for each value of the selector.
  const std::vector<CanFrame> frames = encoded(group, {true, false});
  REQUIRE(frames.size() == 2);
  CHECK(frames[0].same_on_wire(frame(1, 1)));
  CHECK(frames[1].same_on_wire(frame(2, 0)));
}

TEST_CASE("a nested state is told by frames in which all selectors above it say so") {
  const Dbc dbc = parse_dbc(kDbc);
  REQUIRE(dbc.problems.empty());
  PeriodicGroup group(signal_of("Nested", "A"), dbc);
  for (const char* name : {"A", "B", "C", "ALWAYS"}) group.add(signal_of("Nested", name));
  const auto frame = [](std::uint8_t selectors, std::uint8_t states) {
    CanFrame result;
    result.identifier = 305;
    result.num_bytes = 2;
    result.data[0] = selectors;
    result.data[1] = states;
    return result;
  };
  // One frame for A and B, whose selectors are the same, and one for C.
  const std::vector<CanFrame> frames = encoded(group, {1, 0, 1, 1});
  REQUIRE(frames.size() == 2);
  CHECK(frames[0].same_on_wire(frame(0x32, 0x81)));
  CHECK(frames[1].same_on_wire(frame(0x01, 0x81)));
  REQUIRE(group.on_frame(frame(0x33, 0x83), 1));  // PART says so, but is not there
  for (std::size_t i = 0; i < 3; ++i) CHECK(group.reason(i, 1) == InvalidReason::kNotAvailable);
  CHECK(group.state(3));
  REQUIRE(group.on_frame(frame(0x42, 0x03), 1));
  CHECK(group.reason(0, 1) == InvalidReason::kNotAvailable);
  CHECK(group.state(1));
  CHECK(group.reason(2, 1) == InvalidReason::kNotAvailable);
  for (const CanFrame& each : frames) REQUIRE(group.on_frame(each, 2));
  const bool expected[] = {true, false, true, true};
  for (std::size_t i = 0; i < 4; ++i) {
    CHECK(group.reason(i, 2) == InvalidReason::kNone);
    CHECK(group.state(i) == expected[i]);
  }
}

}  // namespace holdfast
