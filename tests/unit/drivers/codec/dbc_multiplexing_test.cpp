// Which signals a frame carries, by selectors and selectors of selectors.
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "drivers/can/dbc.h"
#include "tests/support/catch.h"
#include "tests/support/texts.h"

namespace holdfast {
namespace {

std::string carried(const DbcMessage& message, const std::vector<std::uint8_t>& data) {
  std::string names;
  const std::vector<bool> is_carried = message.carried_signals(data);
  for (std::size_t i = 0; i < message.signals.size(); ++i) {
    const DbcSignal& signal = message.signals[i];
    REQUIRE(message.carries(signal, data) == is_carried.at(i));
    if (is_carried[i]) names += signal.name + " ";
  }
  return names;
}

std::string names_of(const DbcMessage& message) {
  std::string names;
  for (const DbcSignal& signal : message.signals) names += signal.name + " ";
  return names;
}

const char* const kRest = " : 0|8@1+ (1,0) [0|0] \"\" B\n";

// Line 1 is the message; the marks are those of signals of eight bits on the lines from 2 on.
Dbc message_with(const std::vector<std::string>& marks, const std::string& selections) {
  std::string text = "BO_ 5 X: 8 A\n";
  for (const std::string& mark : marks) text += " SG_ " + mark + kRest;
  return parse_dbc(text + selections);
}

// Two selectors at once, each of which has its own signals; and one below both of them in turn.
const char* const kSideBySide =
    "BO_ 5 X: 8 A\n"
    " SG_ P M : 0|4@1+ (1,0) [0|0] \"\" B\n SG_ Q M : 4|4@1+ (1,0) [0|0] \"\" B\n"
    " SG_ ofP m1 : 8|8@1+ (1,0) [0|0] \"\" B\n SG_ ofQ m1 : 16|8@1+ (1,0) [0|0] \"\" B\n"
    " SG_ R m2M : 24|4@1- (1,0) [0|0] \"\" B\n SG_ ofR m3 : 32|8@1+ (1,0) [0|0] \"\" B\n"
    " SG_ below m0 : 40|8@1+ (1,0) [0|0] \"\" B\n"
    "SG_MUL_VAL_ 5 ofP P 1-1, 5-6;\nSG_MUL_VAL_ 5 ofQ Q 1-1;\nSG_MUL_VAL_ 5 R Q 2-3;\n"
    "SG_MUL_VAL_ 5 ofR R 3-3;\nSG_MUL_VAL_ 5 below R -8--1;\n";

// A frame for the signal carries it and gives back what was packed; with any selector above it at a
// value that it does not ask for, the frame carries it no more.
void check_signal(const DbcMessage& message, const DbcSignal& signal) {
  INFO(message.name + "." + signal.name);
  std::optional<CanFrame> frame = message.frame_for({signal});
  REQUIRE(frame);
  REQUIRE(message.matches(*frame));
  REQUIRE(message.carries(signal, frame->bytes()));
  const std::span<std::uint8_t> data(frame->data.data(), frame->num_bytes);
  for (const DbcSignal* selected = &signal; message.selector_of(*selected) != nullptr;) {
    const DbcSignal* selector = message.selector_of(*selected);
    const std::uint64_t right = selector->raw(data);
    int num_refused = 0;
    for (std::uint64_t value = 0; value < std::uint64_t{1} << selector->num_bits; ++value) {
      selector->set_raw(data, value);
      const bool is_asked =
          selected->is_selected_by(static_cast<std::int64_t>(selector->raw(data)));
      CHECK(message.carries(signal, data) == is_asked);
      num_refused += is_asked ? 0 : 1;
    }
    CHECK(num_refused > 0);
    selector->set_raw(data, right);
    selected = selector;
  }
  if (signal.is_selector) return;
  for (const std::uint64_t pattern : {std::uint64_t{0}, ~std::uint64_t{0}, std::uint64_t{0xA5}}) {
    signal.set_raw(data, pattern);
    const std::uint64_t packed = signal.raw(data);
    CHECK((packed ^ pattern) << (64 - signal.num_bits) == 0);
    CHECK(message.carries(signal, data));
    for (const DbcSignal& other : message.signals) {
      if (&other != &signal)
        CHECK((other.is_selector || !message.carries(other, data) || other.raw(data) == 0));
    }
  }
}

}  // namespace

TEST_CASE("multiplexed signals are there when the selector says so") {
  const Dbc dbc = parse_dbc(
      "BO_ 5 Mixed: 8 A\n"
      " SG_ Which M : 0|8@1+ (1,0) [0|0] \"\" B\n"
      " SG_ One m1 : 8|8@1+ (1,0) [0|0] \"\" B\n"
      " SG_ Two m2 : 8|16@1+ (1,0) [0|0] \"\" B\n"
      " SG_ Many m4 : 32|8@1+ (1,0) [0|0] \"\" B\n"
      " SG_ Always : 56|8@1+ (1,0) [0|0] \"\" B\n"
      "SG_MUL_VAL_ 5 Many Which 4-6, 9-9;\n");
  CHECK(dbc.problems.empty());
  const DbcMessage& message = dbc.messages.at(0);
  CHECK(message.find("Which")->is_selector);
  CHECK(message.selector_of(*message.find("Which")) == nullptr);
  CHECK(message.selector_of(*message.find("Many")) == message.find("Which"));
  const auto carried_by = [&](std::uint8_t selector) {
    return carried(message, {selector, 0, 0, 0, 0, 0, 0, 0});
  };
  CHECK(carried_by(0) == "Which Always ");
  CHECK(carried_by(1) == "Which One Always ");
  CHECK(carried_by(2) == "Which Two Always ");
  CHECK(carried_by(4) == "Which Many Always ");
  CHECK(carried_by(6) == "Which Many Always ");
  CHECK(carried_by(7) == "Which Always ");
  CHECK(carried_by(9) == "Which Many Always ");
  // What data that were cut off do not hold they do not carry.
  CHECK(carried(message, {1}) == "Which ");
  CHECK(carried(message, {}).empty());
}

TEST_CASE("a nested signal is there when all selectors above it say so") {
  const Dbc dbc = parse_dbc(testing::file_text("tests/support/dbc_files/nested.dbc"));
  REQUIRE(dbc.problems.empty());
  const DbcMessage& chain = *dbc.find("Chain");
  for (unsigned bits = 0; bits < 64; ++bits) {
    const unsigned outer = bits & 3U, middle = bits >> 2U & 3U, inner = bits >> 4U;
    std::string expected = "Outer ";
    if (outer == 1) {
      expected += "Middle ";
      if (middle >= 2) expected += "Inner ";
      if (middle >= 2 && inner == 3) expected += "Deep ";
      if (middle >= 2 && inner <= 1) expected += "Beside ";
      if (middle == 0) expected += "Flat ";
    }
    if (outer == 0 || outer == 2) expected += "Level ";
    CHECK(carried(chain, {static_cast<std::uint8_t>(bits), 0, 0, 0, 0, 0, 0, 0}) ==
          expected + "Always ");
  }
}

TEST_CASE("every signal has a frame that carries it, as long as no selector above it changes") {
  Dbc dbc = parse_dbc(testing::file_text("tests/support/dbc_files/nested.dbc"));
  dbc.messages.push_back(parse_dbc(kSideBySide).messages.at(0));
  REQUIRE(dbc.messages.size() == 4);
  for (const DbcMessage& message : dbc.messages) {
    for (const DbcSignal& signal : message.signals) check_signal(message, signal);
  }
}

TEST_CASE("a message may have several selectors that are always there") {
  const Dbc dbc = parse_dbc(kSideBySide);
  REQUIRE(dbc.problems.empty());
  const DbcMessage& message = dbc.messages.at(0);
  const auto carried_by = [&](std::uint8_t p, std::uint8_t q, std::uint8_t r) {
    return carried(message, {static_cast<std::uint8_t>(p | q << 4), 0, 0, r, 0, 0, 0, 0});
  };
  CHECK(carried_by(0, 0, 3) == "P Q ");
  CHECK(carried_by(1, 0, 3) == "P Q ofP ");
  CHECK(carried_by(6, 1, 3) == "P Q ofP ofQ ");
  CHECK(carried_by(1, 2, 3) == "P Q ofP R ofR ");
  CHECK(carried_by(0, 3, 2) == "P Q R ");
  CHECK(carried_by(0, 3, 0xF) == "P Q R below ");
  // Least values for what is asked for, zero for the rest.
  const auto frame = message.frame_for({*message.find("ofP"), *message.find("ofR")});
  REQUIRE(frame);
  CHECK(frame->data[0] == 0x21);
  CHECK(frame->data[3] == 3);
  CHECK_FALSE(message.frame_for({*message.find("ofQ"), *message.find("R")}));
  CHECK(message.frame_for({}).value().same_on_wire(message.empty_frame()));
}

TEST_CASE("a selector that nothing names selects what names none, while it is the only one") {
  CHECK(message_with({"S M", "T m1M", "u m3"}, "").problems.empty());
  const Dbc two = message_with({"S M", "T M", "u m0", "v m1"}, "SG_MUL_VAL_ 5 v T 1-1;\n");
  REQUIRE(two.problems.size() == 1);
  CHECK(two.problems[0].line == 4);
  CHECK(two.problems[0].column == 6);
  CHECK(names_of(two.messages.at(0)) == "S T v ");
}

TEST_CASE("a signal of which cannot be told when it is there is left out, the rest stays") {
  struct Case {
    std::vector<std::string> marks;
    std::string selections;
    std::vector<std::pair<int, int>> places;  // line and column of each problem
    std::string kept;
  };
  const std::vector<Case> cases = {
      {{"a m1", "b"}, "", {{2, 6}}, "b "},
      {{"S M", "a m1", "b"}, "SG_MUL_VAL_ 5 a T 1-1;\n", {{5, 17}}, "S b "},
      {{"S M", "a m1", "b"}, "SG_MUL_VAL_ 5 a b 1-1;\n", {{5, 17}}, "S b "},
      // A selector that was left out takes with it what it selects, however far down.
      {{"S M", "T m1M", "U m1M", "a m1"},
       "SG_MUL_VAL_ 5 T N 1-1;\nSG_MUL_VAL_ 5 U T 1-1;\nSG_MUL_VAL_ 5 a U 1-1;\n",
       {{6, 17}, {7, 17}, {8, 17}},
       "S "},
      // Circles of one, two and three, and what hangs from one.
      {{"S M", "a m0M"}, "SG_MUL_VAL_ 5 a a 0-0;\n", {{4, 17}}, "S "},
      {{"S M", "a m0M", "b m0M", "c m0", "d m0"},
       "SG_MUL_VAL_ 5 a b 0-0;\nSG_MUL_VAL_ 5 b a 0-0;\nSG_MUL_VAL_ 5 c b 0-0;\n"
       "SG_MUL_VAL_ 5 d S 0-0;\n",
       {{7, 17}, {8, 17}, {9, 17}},
       "S d "},
      {{"a m0M", "b m0M", "c m0M"},
       "SG_MUL_VAL_ 5 a b 0-0;\nSG_MUL_VAL_ 5 b c 0-0;\nSG_MUL_VAL_ 5 c a 0-0;\n",
       {{5, 17}, {6, 17}, {7, 17}},
       ""},
      // Ranges that are none.
      {{"S M", "a m1"}, "SG_MUL_VAL_ 5 a S;\n", {{4, 18}}, "S "},
      {{"S M", "a m1"}, "SG_MUL_VAL_ 5 a S 1;\n", {{4, 20}}, "S "},
      {{"S M", "a m1"}, "SG_MUL_VAL_ 5 a S 1-;\n", {{4, 21}}, "S "},
      {{"S M", "a m1"}, "SG_MUL_VAL_ 5 a S 1-1, ;\n", {{4, 24}}, "S "},
      {{"S M", "a m1"}, "SG_MUL_VAL_ 5 a S 1-1, 4-3;\n", {{4, 24}}, "S "},
      {{"S M", "a m1"}, "SG_MUL_VAL_ 5 a ;\n", {{4, 17}}, "S "},
      // One that is always there stays so.
      {{"S M", "a"}, "SG_MUL_VAL_ 5 a S 1-1;\n", {{4, 17}}, "S a "}};
  for (const Case& it : cases) {
    const Dbc dbc = message_with(it.marks, it.selections);
    INFO(it.selections + it.kept);
    REQUIRE(dbc.messages.size() == 1);
    CHECK(names_of(dbc.messages[0]) == it.kept);
    std::vector<std::pair<int, int>> places;
    for (const DbcProblem& problem : dbc.problems) {
      places.emplace_back(problem.line, problem.column);
      CHECK_FALSE(problem.text.empty());
    }
    CHECK(places == it.places);
  }
}

TEST_CASE("a later good selection does not bring back what was left out") {
  const Dbc dbc = message_with({"S M", "a m1"}, "SIG_VALTYPE_ 5 a : 1;\nSG_MUL_VAL_ 5 a S 1-1;\n");
  CHECK(dbc.problems.size() == 1);
  CHECK(names_of(dbc.messages.at(0)) == "S ");
}

TEST_CASE("a selector gets the least value that it can have, whatever a range begins with") {
  struct Case {
    const char* selector;  // bits, and + (unsigned) or - (signed)
    const char* ranges;
    std::optional<std::uint64_t> raw;  // of the selector in the frame that carries the signal
  };
  const Case cases[] = {{"3@1+", "-5-1", 0},
                        {"3@1+", "6-9", 6},
                        {"3@1+", "8-9", std::nullopt},
                        {"3@1+", "-5--1", std::nullopt},
                        {"3@1+", "-5--1, 9-9, 4-5", 4},
                        {"4@1-", "15-15", std::nullopt},
                        {"4@1-", "-20-3", 8},
                        {"4@1-", "-3-3", 13},
                        {"1@1-", "-1-0", 1},
                        {"1@1-", "0-5", 0},
                        {"1@1-", "1-5", std::nullopt},
                        {"64@1+", "-5-1", 0},
                        {"64@1+", "-5--1", std::nullopt},
                        {"64@1-", "-5-1", ~std::uint64_t{0} - 4}};
  for (const auto& [selector, ranges, raw] : cases) {
    INFO(std::string(selector) + " " + ranges);
    const Dbc dbc = parse_dbc("BO_ 5 X: 9 A\n SG_ S M : 0|" + std::string(selector) +
                              " (1,0) [0|0] \"\" B\n SG_ a m0 : 64|8@1+ (1,0) [0|0] \"\" B\n"
                              "SG_MUL_VAL_ 5 a S " +
                              ranges + ";\n");
    REQUIRE(dbc.problems.empty());
    const DbcMessage& message = dbc.messages.at(0);
    const DbcSignal& only = *message.find("S");
    const auto frame = message.frame_for({*message.find("a")});
    REQUIRE(frame.has_value() == raw.has_value());
    if (raw) CHECK((only.raw(frame->bytes()) ^ *raw) << (64 - only.num_bits) == 0);
  }
}

TEST_CASE("a float selects nothing: it stays, and what it would select is left out") {
  const char* const text =
      "BO_ 5 X: 8 A\n"
      " SG_ S M : 0|32@1- (1,0) [0|0] \"\" B\n"
      " SG_ a m1 : 32|8@1+ (1,0) [0|0] \"\" B\n"
      " SG_ T m2M : 40|8@1+ (1,0) [0|0] \"\" B\n"
      " SG_ b m0 : 48|8@1+ (1,0) [0|0] \"\" B\n"
      " SG_ c : 56|8@1+ (1,0) [0|0] \"\" B\n"
      "SG_MUL_VAL_ 5 b T 0-0;\n";
  CHECK(names_of(parse_dbc(text).messages.at(0)) == "S a T b c ");
  const Dbc dbc = parse_dbc(std::string(text) + "SIG_VALTYPE_ 5 S : 1;\n");
  CHECK(names_of(dbc.messages.at(0)) == "S c ");
  CHECK_FALSE(dbc.messages.at(0).find("S")->is_selector);
  std::vector<std::pair<int, int>> places;
  for (const DbcProblem& problem : dbc.problems) places.emplace_back(problem.line, problem.column);
  CHECK(places == std::vector<std::pair<int, int>>{{3, 6}, {4, 6}, {7, 17}, {8, 20}});
  CHECK(dbc.problems.back().text ==
        "'S' is a float and cannot select: what it selects is left out");

  // It does not leave the choice to the other one of two.
  const Dbc two = parse_dbc(
      "BO_ 5 X: 8 A\n SG_ S M : 0|32@1- (1,0) [0|0] \"\" B\n SG_ T M : 32|8@1+ (1,0) [0|0] \"\" B\n"
      " SG_ a m1 : 40|8@1+ (1,0) [0|0] \"\" B\n SG_ b m1 : 48|8@1+ (1,0) [0|0] \"\" B\n"
      "SG_MUL_VAL_ 5 b T 1-1;\nSIG_VALTYPE_ 5 S : 1;\n");
  CHECK(names_of(two.messages.at(0)) == "S T b ");
  CHECK(two.problems.size() == 2);
}

TEST_CASE("a selector of too few bits carries nothing, and a long chain is followed") {
  const Dbc narrow = parse_dbc(
      "BO_ 5 X: 8 A\n SG_ S M : 0|2@1+ (1,0) [0|0] \"\" B\n SG_ a m9 : 8|8@1+ (1,0) [0|0] \"\" "
      "B\n");
  REQUIRE(narrow.problems.empty());
  CHECK_FALSE(narrow.messages.at(0).frame_for({*narrow.messages.at(0).find("a")}));
  std::string text = "BO_ 5 X: 8 A\n SG_ s0 M : 0|1@1+ (1,0) [0|0] \"\" B\n", selections;
  constexpr int kDepth = 2000;
  for (int i = 1; i <= kDepth; ++i) {
    const std::string name = "s" + std::to_string(i);
    text += " SG_ " + name + " m1M : 0|1@1+ (1,0) [0|0] \"\" B\n";
    selections += "SG_MUL_VAL_ 5 " + name + " s" + std::to_string(i - 1) + " 1-1;\n";
  }
  const Dbc deep = parse_dbc(text + selections);
  REQUIRE(deep.problems.empty());
  const DbcMessage& message = deep.messages.at(0);
  const auto frame = message.frame_for({message.signals.back()});
  REQUIRE(frame);
  CHECK(frame->data[0] == 1);
  CHECK_FALSE(message.carries(message.signals.back(), message.empty_frame().bytes()));
  CHECK(carried(message, {1}) == names_of(message));
  CHECK(carried(message, {0}) == "s0 ");
}

}  // namespace holdfast
