// A bus that nobody has described.
#include "tools/bus_look.h"

#include "drivers/sensors/canopen_node.h"
#include "tests/support/catch.h"

namespace holdfast {
namespace {

bool says(const BusLook& look, const std::string& part) {
  const std::string text = look.text();
  UNSCOPED_INFO(text);
  return text.find(part) != std::string::npos;
}

CanFrame wide(std::uint32_t identifier, std::initializer_list<std::uint8_t> bytes) {
  CanFrame frame = canopen_frame(identifier, bytes);
  frame.flags = CanFrame::kExtended;
  return frame;
}

}  // namespace

TEST_CASE("identifiers with their rates, changing bits and what they may be") {
  BusLook look;
  CHECK(says(look, "No frame came"));
  for (int i = 0; i <= 10; ++i) {
    look.on_frame(canopen_frame(0x705, {0x05}), i * 100'000'000LL);
    look.on_frame(canopen_frame(0x185, {static_cast<std::uint8_t>(i % 2 == 0 ? 0x40 : 0x44), 0x01}),
                  i * 100'000'000LL);
    look.on_frame(wide(0x0DF20D21, {0, static_cast<std::uint8_t>(i % 3), 0xFF}), i * 200'000'000LL);
  }
  CHECK(look.num_frames() == 33);
  CHECK(says(look, "CANopen heartbeat of node 5?"));
  CHECK(says(look, "CANopen TPDO1 of node 5?"));
  CHECK(says(look, "J1939 group 127501 of 33?"));
  CHECK(says(look, "04 00"));  // the bit that changed
  // The only input that moved is offered, and the group's two bits.
  CHECK(says(look, "- {canopen: {node: 5, input: 3}}"));
  CHECK_FALSE(says(look, "input: 7"));
  CHECK(says(look, "- {j1939: {pgn: 127501, source: 33, instance: 0, item: 1}}"));
  CHECK_FALSE(says(look, "item: 2"));
}

TEST_CASE("what a DBC names is named, and its narrow signals are offered") {
  const Dbc dbc = parse_dbc(
      "BO_ 256 Level: 1 V\n SG_ HIGH : 0|1@1+ (1,0) [0|1] \"\" V\n SG_ RAW : 1|7@1+ (1,0) [0|1] "
      "\"\" V\n");
  BusLook look(dbc);
  look.on_frame(canopen_frame(0x100, {0x01}), 0);
  CHECK(says(look, "Level"));
  CHECK(says(look, "- {dbc: {message: Level, signal: HIGH}}"));
  CHECK_FALSE(says(look, "signal: RAW"));
  look.on_frame(canopen_frame(0x100, {0x01, 0x02}), 1);
  CHECK(says(look, "another form"));
}

TEST_CASE("requests, other lengths and other banks are no changes") {
  BusLook look;
  CanFrame request = canopen_frame(0x185, {0});
  request.flags |= CanFrame::kRemote;
  look.on_frame(canopen_frame(0x185, {0xFF}), 0);
  look.on_frame(request, 1);
  look.on_frame(canopen_frame(0x185, {0xFF, 0xFF}), 2);
  look.on_frame(canopen_frame(0x185, {0xFF}), 3);
  look.on_frame(wide(0x0DF20D21, {0, 0x55}), 4);
  look.on_frame(wide(0x0DF20D21, {1, 0xAA}), 5);
  look.on_frame(wide(0x0DF20D21, {0, 0x55}), 6);
  look.on_frame(wide(0x18FED921, {0x40}), 7);
  look.on_frame(wide(0x18FED921, {0x00}), 8);
  CHECK_FALSE(says(look, "canopen: {"));
  CHECK_FALSE(says(look, "instance"));
  CHECK(says(look, "- {j1939: {pgn: 65241, source: 33, start_bit: 6}}"));
}

TEST_CASE("a flood of identifiers does not fill the memory, and is told") {
  BusLook look;
  for (std::uint32_t i = 0; i < BusLook::kIdentifiersMax + 10; ++i) look.on_frame(wide(i, {1}), i);
  CHECK(says(look, "10 frames of further identifiers"));
}

}  // namespace holdfast
