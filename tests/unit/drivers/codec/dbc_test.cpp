#include "drivers/can/dbc.h"
#include "tests/support/catch.h"
#include "tests/support/texts.h"

namespace holdfast {
namespace {

TEST_CASE("a message with all that a signal says") {
  const Dbc dbc = parse_dbc(
      "BO_ 291 Wheel: 8 Brake\n"
      " SG_ Speed : 7|16@0- (0.01,-40) [-40|287.67] \"km/h\" Dash,Gateway\n"
      " SG_ Valid : 16|1@1+ (1,0) [0|1] \"\" Vector__XXX\n"
      "VAL_ 291 Valid 0 \"no; not yet\" 1 \"yes\" ;\n");
  CHECK(dbc.problems.empty());
  REQUIRE(dbc.messages.size() == 1);
  const DbcMessage& message = dbc.messages[0];
  CHECK(message.name == "Wheel");
  CHECK(message.identifier == 0x123);
  CHECK_FALSE(message.is_extended);
  CHECK_FALSE(message.is_fd);
  CHECK(message.num_bytes == 8);
  CHECK(message.sender == "Brake");
  REQUIRE(message.signals.size() == 2);
  const DbcSignal& speed = *message.find("Speed");
  CHECK(speed.start_bit == 7);
  CHECK(speed.num_bits == 16);
  CHECK_FALSE(speed.is_little_endian);
  CHECK(speed.kind == DbcSignal::Kind::kSigned);
  CHECK(speed.scale == 0.01);
  CHECK(speed.offset == -40.0);
  CHECK(speed.minimum == -40.0);
  CHECK(speed.maximum == 287.67);
  CHECK(speed.unit == "km/h");
  const DbcSignal& valid = *message.find("Valid");
  CHECK(valid.is_little_endian);
  CHECK(valid.kind == DbcSignal::Kind::kUnsigned);
  CHECK(valid.value_names == std::map<std::int64_t, std::string>{{0, "no; not yet"}, {1, "yes"}});
  CHECK(message.find("speed") == nullptr);
  CHECK(dbc.find("Wheel") == &message);
  CHECK(dbc.find(0x123, false) == &message);
  CHECK(dbc.find(0x123, true) == nullptr);
}

TEST_CASE("bit 31 of the identifier marks a 29-bit one") {
  const Dbc dbc = parse_dbc("BO_ 2566844926 Engine: 8 Vector__XXX\n");
  REQUIRE(dbc.messages.size() == 1);
  CHECK(dbc.messages[0].is_extended);
  CHECK(dbc.messages[0].identifier == 0x18FEF1FE);
  CHECK(dbc.messages[0].sender.empty());
  CanFrame frame = dbc.messages[0].empty_frame();
  CHECK(frame.has(CanFrame::kExtended));
  CHECK(frame.num_bytes == 8);
  CHECK(dbc.messages[0].matches(frame));
  frame.flags = 0;
  CHECK_FALSE(dbc.messages[0].matches(frame));
}

TEST_CASE("SIG_VALTYPE_ makes floats of the right width") {
  const Dbc dbc = parse_dbc(
      "BO_ 1 M: 24 A\n SG_ f : 0|32@1- (1,0) [0|0] \"\" B\n SG_ d : 71|64@0- (1,0) [0|0] \"\" B\n"
      " SG_ i : 128|16@1- (1,0) [0|0] \"\" B\n SG_ wrong : 144|16@1- (1,0) [0|0] \"\" B\n"
      "SIG_VALTYPE_ 1 f : 1;\nSIG_VALTYPE_ 1 d 2;\nSIG_VALTYPE_ 1 i : 0;\nSIG_VALTYPE_ 1 wrong : "
      "1;\n");
  const DbcMessage& message = dbc.messages.at(0);
  CHECK(message.find("f")->kind == DbcSignal::Kind::kFloat32);
  CHECK(message.find("d")->kind == DbcSignal::Kind::kFloat64);
  CHECK(message.find("i")->kind == DbcSignal::Kind::kSigned);
  CHECK(message.find("wrong") == nullptr);
  REQUIRE(dbc.problems.size() == 1);
  CHECK(dbc.problems[0].line == 9);
}

TEST_CASE("VFrameFormat says which messages are FD") {
  const std::string messages =
      "BO_ 1 A: 8 X\nBO_ 2 B: 8 X\nBO_ 3 C: 8 X\nBO_ 4 D: 12 X\nBO_ 5 E: 8 X\n";
  const auto fd_names = [&](const std::string& attributes) {
    const Dbc dbc = parse_dbc(messages + attributes);
    CHECK(dbc.problems.empty());
    std::string names;
    for (const DbcMessage& message : dbc.messages) names += message.is_fd ? message.name : "";
    return names;
  };
  CHECK(fd_names("") == "D");
  CHECK(fd_names("BA_DEF_ BO_ \"VFrameFormat\" INT 0 15;\nBA_ \"VFrameFormat\" BO_ 1 14;\n"
                 "BA_ \"VFrameFormat\" BO_ 2 15;\nBA_ \"VFrameFormat\" BO_ 3 0;\n") == "ABD");
  const std::string choices =
      "BA_DEF_ BO_  \"VFrameFormat\" ENUM  \"StandardCAN\",\"StandardCAN_FD\";\n";
  CHECK(fd_names(choices + "BA_ \"VFrameFormat\" BO_ 1 1;\nBA_ \"VFrameFormat\" BO_ 2 0;\n") ==
        "AD");
  CHECK(fd_names(choices + "BA_ \"VFrameFormat\" BO_ 3 \"StandardCAN_FD\";\n") == "CD");
  CHECK(fd_names(
            choices +
            "BA_DEF_DEF_ \"VFrameFormat\" \"StandardCAN_FD\";\nBA_ \"VFrameFormat\" BO_ 5 0;\n") ==
        "ABCD");
}

TEST_CASE("an FD message of an odd length fills the next frame there is") {
  const Dbc dbc = parse_dbc("BO_ 4 D: 10 X\n");
  const CanFrame frame = dbc.messages.at(0).empty_frame();
  CHECK(frame.num_bytes == 12);
  CHECK(frame.has(CanFrame::kFd));
  CHECK(dbc.messages.at(0).matches(frame));
}

TEST_CASE("a frame of another format is not the message's") {
  const Dbc dbc = parse_dbc("BO_ 4 D: 3 X\n");
  const DbcMessage& message = dbc.messages.at(0);
  const CanFrame right = message.empty_frame();
  CHECK(message.matches(right));
  for (const auto flag :
       {CanFrame::kExtended, CanFrame::kRemote, CanFrame::kError, CanFrame::kFd}) {
    CanFrame wrong = right;
    wrong.flags = flag;
    CHECK_FALSE(message.matches(wrong));
  }
  for (const int num_bytes : {0, 1, 2, 4, 8}) {
    CanFrame wrong = right;
    wrong.num_bytes = static_cast<std::uint8_t>(num_bytes);
    CHECK_FALSE(message.matches(wrong));
  }
}

TEST_CASE("the shipped file of the binary sensors is what the scenarios rely on") {
  const Dbc dbc = parse_dbc(testing::file_text("scenarios/binary_sensors.dbc"));
  CHECK(dbc.problems.empty());
  REQUIRE(dbc.messages.size() == 17);
  for (std::uint32_t i = 1; i <= 16; ++i) {
    const DbcMessage* message = dbc.find(0x100 + i, false);
    REQUIRE(message != nullptr);
    CHECK(message->name == (i < 10 ? "Sensor0" : "Sensor") + std::to_string(i));
    CHECK(message->num_bytes == 3);
    CHECK_FALSE(message->is_fd);
    CHECK(message->find("DETECT")->num_bits == 1);
    CHECK(message->find("DETECT")->value_names.at(1) == "target");
    CHECK(message->find("STEP")->start_bit == 8);
  }
  CHECK(dbc.find(0x7F0, false)->name == "StepTick");
  CHECK(dbc.find("StepTick")->num_bytes == 4);
}

}  // namespace
}  // namespace holdfast
