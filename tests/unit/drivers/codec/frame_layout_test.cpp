#include <filesystem>
#include <fstream>

#include "drivers/can/command_codec.h"
#include "drivers/can/frame_codec.h"
#include "tests/support/catch.h"

namespace holdfast {
namespace {

const std::string kFolder = std::string(HOLDFAST_SOURCE_DIR) + "/scenarios";

std::string network(const std::string& lines) {
  return "network:\n" + lines;
}

// All problems of the file as text; empty when there are none.
std::string problems_of(const std::string& yaml, FrameLayout& layout,
                        std::string* resolved = nullptr, const std::string& folder = kFolder) {
  ConfigurationDocument document = ConfigurationDocument::from_text(yaml, "s.yaml");
  layout.read(document.root().map("network"), folder);
  try {
    document.finish();
  } catch (const ConfigurationError& error) {
    return error.what();
  }
  if (resolved != nullptr) *resolved = document.resolved_text();
  return "";
}

bool says(const std::string& problems, const std::string& text) {
  UNSCOPED_INFO(problems);
  return problems.find(text) != std::string::npos;
}

const std::string kGood =
    "  dbc: binary_sensors.dbc\n  messages: [Sensor01, Sensor16]\n  signals: [DETECT]\n  "
    "counter_signal: STEP\n";

TEST_CASE("a layout from a file, and again from its resolved document") {
  FrameLayout layout;
  std::string resolved;
  CHECK(problems_of(network(kGood), layout, &resolved) == "");
  CHECK(layout.dbc.messages.size() == 17);
  CHECK(layout.messages == std::vector<std::string>{"Sensor01", "Sensor16"});
  CHECK(layout.tick_message == "StepTick");
  CHECK(resolved.find("dbc_text") != std::string::npos);
  CHECK(resolved.find("dbc:") == std::string::npos);
  CHECK(resolved.find("binary_sensors.dbc") == std::string::npos);

  // The resolved document needs no file, and resolves to itself.
  FrameLayout again;
  std::string resolved_again;
  CHECK(problems_of(resolved, again, &resolved_again, "/nowhere") == "");
  CHECK(resolved_again == resolved);
  CHECK(again.dbc.messages.size() == 17);
  const std::vector<double> one = {1.0};
  CHECK(FrameCodec(again).encode(1, one, 3).same_on_wire(FrameCodec(layout).encode(1, one, 3)));
}

TEST_CASE("a DBC of Windows-1252 with tabs and CRLF survives the resolved document") {
  const std::filesystem::path folder =
      std::filesystem::path(HOLDFAST_BINARY_DIR) / "frame_layout_test";
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "odd.dbc", std::ios::binary)
      << "BO_ 1 M: 8 A\r\n\tSG_ T : 0|8@1+ (1,0) [0|0] \"\xB0"
         "C\" B\r\nBO_ 2032 StepTick: 4 A\r\n SG_ STEP : 0|32@1+ (1,0) [0|0] \"\" B\r\n";
  FrameLayout layout, again;
  std::string resolved;
  CHECK(problems_of(network("  dbc: odd.dbc\n  messages: [M]\n  signals: [T]\n"), layout, &resolved,
                    folder.string()) == "");
  CHECK(problems_of(resolved, again) == "");
  CHECK(again.dbc.find("M")->find("T")->unit ==
        "\xC2\xB0"
        "C");
}

TEST_CASE("wrong names are problems that say what there is") {
  FrameLayout a, b, c, d, e, f, g, h;
  CHECK(says(
      problems_of(
          network("  dbc: binary_sensors.dbc\n  messages: [Sensor99]\n  signals: [DETECT]\n"), a),
      "s.yaml:3:13: network.messages: 'Sensor99' is no message of the DBC; it has Sensor01, "));
  CHECK(says(
      problems_of(
          network("  dbc: binary_sensors.dbc\n  messages: [Sensor01]\n  signals: [VALUE]\n"), b),
      "network.signals: message 'Sensor01' has no signal 'VALUE'; it has DETECT, STEP"));
  CHECK(says(problems_of(network(kGood + "  tick: {message: Tock}\n"), c),
             "network.tick.message: 'Tock' is no message"));
  CHECK(says(problems_of(network(kGood + "  tick: {signal: NONE}\n"), d),
             "network.tick.signal: message 'StepTick' has no"));
  CHECK(says(
      problems_of(
          network(
              "  dbc: binary_sensors.dbc\n  messages: [Sensor01, Sensor01]\n  signals: [DETECT]\n"),
          e),
      "'Sensor01' is given twice"));
  CHECK(says(
      problems_of(network("  dbc: binary_sensors.dbc\n  messages: [StepTick]\n  signals: [STEP]\n"),
                  f),
      "is the tick"));
  CHECK(says(problems_of(network("  dbc: binary_sensors.dbc\n  messages: [Sensor01]\n  signals: "
                                 "[STEP]\n  counter_signal: STEP\n"),
                         g),
             "shares bits"));
  CHECK(says(problems_of(network("  dbc: binary_sensors.dbc\n  messages: []\n  signals: []\n"), h),
             "at least one message"));
}

TEST_CASE("the bits of every selector above a signal are in use") {
  const std::string dbc =
      "  dbc_text: |\n    BO_ 1 M: 8 A\n     SG_ PAGE M : 0|4@1+ (1,0) [0|0] \"\" B\n"
      "     SG_ PART m1M : 4|4@1+ (1,0) [0|0] \"\" B\n     SG_ DEEP m2 : 8|8@1+ (1,0) [0|0] \"\" "
      "B\n"
      "     SG_ COUNT : 3|8@1+ (1,0) [0|0] \"\" B\n     SG_ WIDE m2 : 6|8@1+ (1,0) [0|0] \"\" B\n"
      "    BO_ 2032 StepTick: 4 A\n     SG_ STEP : 0|32@1+ (1,0) [0|0] \"\" B\n"
      "    SG_MUL_VAL_ 1 DEEP PART 2-2;\n    SG_MUL_VAL_ 1 WIDE PART 2-2;\n  messages: [M]\n";
  FrameLayout good, page, part;
  CHECK(problems_of(network(dbc + "  signals: [DEEP]\n"), good) == "");
  CHECK(says(problems_of(network(dbc + "  signals: [DEEP]\n  counter_signal: COUNT\n"), page),
             "shares bits"));
  CHECK(says(problems_of(network(dbc + "  signals: [WIDE]\n"), part), "shares bits"));
}

TEST_CASE("a file that is missing, or given twice, or not at all") {
  FrameLayout a, b, c, d;
  CHECK(says(problems_of(network("  dbc: none.dbc\n  messages: [A]\n  signals: [B]\n"), a),
             "none.dbc cannot be read"));
  CHECK(says(problems_of(network("  dbc: ../scenarios\n  messages: [A]\n  signals: [B]\n"), b),
             "cannot be read"));
  CHECK(says(problems_of(network("  messages: [A]\n  signals: [B]\n"), c), "network.dbc: missing"));
  CHECK(says(problems_of(network(kGood + "  dbc_text: 'x'\n"), d), "not both"));
  FrameLayout e;
  const std::string all = problems_of(network("  dbc: binary_sensors.dbc\n"), e);
  CHECK(says(all, "network.messages: missing"));
  CHECK(says(all, "network.signals: missing"));
}

TEST_CASE("problems of the DBC are problems of the scenario, with their place in it") {
  FrameLayout layout;
  const std::string text =
      problems_of(network("  dbc_text: \"BO_ 1 M: 8 A\\n SG_ T : 0|8@1+ (0,0) [0|0] \\\"\\\" "
                          "B\\n\"\n  messages: [M]\n  signals: [T]\n"),
                  layout);
  CHECK(says(text, "dbc_text:2:18: scale must not be 0"));
}

TEST_CASE("counters that cannot count are problems") {
  const std::string tick =
      "BO_ 2032 StepTick: 4 A\\n SG_ STEP : 0|32@1+ (1,0) [0|0] \\\"\\\" B\\n\"\n";
  const auto with = [&](const std::string& signal_a, const std::string& signal_b) {
    return network(
        "  dbc_text: \"BO_ 1 M: 8 A\\n SG_ V : 0|8@1+ (1,0) [0|0] \\\"\\\" B\\n SG_ C : " +
        signal_a +
        " [0|0] \\\"\\\" B\\nBO_ 2 N: 8 A\\n SG_ V : 0|8@1+ (1,0) [0|0] \\\"\\\" B\\n SG_ C : " +
        signal_b + " [0|0] \\\"\\\" B\\n" + tick +
        "  messages: [M, N]\n  signals: [V]\n  counter_signal: C\n");
  };
  FrameLayout a, b, c, d;
  CHECK(problems_of(with("8|16@1+ (1,0)", "23|16@0+ (1,0)"), a) == "");
  CHECK(says(problems_of(with("8|16@1+ (1,0)", "8|8@1+ (1,0)"), b),
             "has 8 bits in message 'N', 16 in others"));
  CHECK(
      says(problems_of(with("8|16@1- (1,0)", "8|16@1+ (1,0)"), c), "must be an unsigned integer"));
  CHECK(
      says(problems_of(with("8|16@1+ (2,0)", "8|16@1+ (1,0)"), d), "must be an unsigned integer"));
}

TEST_CASE("signals that no single frame carries are a problem") {
  FrameLayout layout;
  CHECK(
      says(problems_of(
               network("  dbc_text: \"BO_ 1 X: 4 A\\n SG_ W M : 0|4@1+ (1,0) [0|0] \\\"\\\" M\\n"
                       " SG_ A m3 : 8|8@1+ (1,0) [0|0] \\\"\\\" M\\n SG_ C m4 : 16|8@1+ (1,0) "
                       "[0|0] \\\"\\\" M\\n"
                       "BO_ 2032 StepTick: 4 A\\n SG_ STEP : 0|32@1+ (1,0) [0|0] \\\"\\\" B\\n\"\n"
                       "  messages: [X]\n  signals: [A, C]\n"),
               layout),
           "no frame of message X carries all its signals"));
}

}  // namespace
const std::string kBreakers =
    "  dbc: three_area.dbc\n  messages: [Area1, Area2]\n  signals: [OMEGA]\n  counter_signal: "
    "STEP\n";

TEST_CASE("commands to the plant are frames and back, whatever the mode and step") {
  FrameLayout layout;
  std::string resolved;
  REQUIRE(problems_of(network(kBreakers + "  command: {message: BreakerCommand}\n"), layout,
                      &resolved) == "");
  CHECK(layout.command.exists());
  CHECK(layout.command.mode_signal == "MODE");
  FrameLayout again;
  CHECK(problems_of(resolved, again) == "");
  CHECK(again.command.message == "BreakerCommand");
  const CommandCodec codec(layout);
  for (const ModeChange& command : {ModeChange{1, 0}, {70000, 255}, {4294967295, 7}}) {
    const CanFrame frame = codec.encode(command);
    CHECK(codec.has_identifier(frame));
    const auto decoded = codec.decode(frame);
    REQUIRE(decoded.has_value());
    CHECK(decoded->mode == command.mode);
    CHECK(decoded->from_step == command.from_step);
    std::vector<double> values;
    CHECK(FrameCodec(layout).decode(frame, values).kind == FrameCodec::Kind::kUnknown);
  }
  CanFrame frame = codec.encode({9, 1});
  frame.flags ^= CanFrame::kFd;
  CHECK_FALSE(codec.decode(frame).has_value());
  CHECK(codec.has_identifier(frame));
  // A network without commands has none.
  FrameLayout silent;
  REQUIRE(problems_of(network(kBreakers), silent) == "");
  CHECK_FALSE(CommandCodec(silent).has_identifier(codec.encode({9, 1})));
  CHECK_FALSE(CommandCodec(silent).decode(codec.encode({9, 1})).has_value());
}

TEST_CASE("a command that could not be read is refused with its reason") {
  FrameLayout layout;
  const auto problem = [&](const std::string& command) {
    layout = {};
    return problems_of(network(kBreakers + "  command: " + command + "\n"), layout);
  };
  CHECK(says(problem("{mode: MODE}"), "message: missing"));
  CHECK(says(problem("{message: Breaker}"), "'Breaker' is no message of the DBC"));
  CHECK(says(problem("{message: Area1, mode: STEP}"), "is a reading or the tick already"));
  CHECK(says(problem("{message: StepTick, mode: STEP}"), "is a reading or the tick already"));
  CHECK(says(problem("{message: BreakerCommand, mode: AJAR}"), "has no signal 'AJAR'"));
  CHECK(says(problem("{message: BreakerCommand, mode: STEP, step: MODE}"), "at most 16 bits"));
  CHECK(says(problem("{message: BreakerCommand, mode: MODE, step: MODE}"), "shares bits"));
  CHECK(says(problem("{message: Area3, mode: OMEGA}"), "must be an unsigned integer"));
}

}  // namespace holdfast
