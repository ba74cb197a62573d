// What real files hold that the grammar does not, and that one bad line loses nothing else.
#include <algorithm>

#include "drivers/can/dbc.h"
#include "tests/support/catch.h"

namespace holdfast {
namespace {

const std::string kBefore = "BO_ 10 Before: 8 A\n SG_ x : 0|8@1+ (1,0) [0|0] \"\" B\n";
const std::string kAfter =
    "BO_ 11 After: 8 A\n SG_ y : 0|8@1+ (1,0) [0|0] \"\" B\nVAL_ 11 y 1 \"one\";\n";

bool rest_is_there(const Dbc& dbc) {
  const DbcMessage* before = dbc.find("Before");
  const DbcMessage* after = dbc.find("After");
  return before != nullptr && before->find("x") != nullptr && after != nullptr &&
         after->find("y") != nullptr && after->find("y")->value_names.size() == 1;
}

TEST_CASE("each bad line is one problem with its place, and loses nothing else") {
  struct Bad {
    std::string text;
    int column;
  };
  // The bad line is line 3.
  const std::vector<Bad> all = {{"BO_ ten Name: 8 A", 5},
                                {"BO_ 12 Name 8 A", 13},
                                {"BO_ 12 Name: many A", 14},
                                {"BO_ 12 Name: 65 A", 4},
                                {"BO_ 99999999999 Name: 8 A", 4},
                                {"BO_ 2048 Name: 8 A", 4},
                                {"BO_ 10 Again: 8 A", 4},
                                {"BO_ 12 Before: 8 A", 4},
                                {" SG_ a : 0|8@1+ (1,0) [0|0] \"open B", 29},
                                {" SG_ a : 0|8@1 (1,0) [0|0] \"\" B", 16},
                                {" SG_ a : 0|8@3+ (1,0) [0|0] \"\" B", 14},
                                {" SG_ a : 0|65@1+ (1,0) [0|0] \"\" B", 10},
                                {" SG_ a : 0|0@1+ (1,0) [0|0] \"\" B", 10},
                                {" SG_ a : 512|1@1+ (1,0) [0|0] \"\" B", 10},
                                {" SG_ a : 57|8@1+ (1,0) [0|0] \"\" B", 6},
                                {" SG_ a : 62|8@0+ (1,0) [0|0] \"\" B", 6},
                                {" SG_ x : 8|8@1+ (1,0) [0|0] \"\" B", 6},
                                {" SG_ a : 0|8@1+ (0,0) [0|0] \"\" B", 18},
                                {" SG_ a : 0|8@1+ (nan,0) [0|0] \"\" B", 18},
                                {" SG_ a : 0|8@1+ (1e999,0) [0|0] \"\" B", 18},
                                {" SG_ a q1 : 0|8@1+ (1,0) [0|0] \"\" B", 8},
                                {" SG_ a m-1 : 0|8@1+ (1,0) [0|0] \"\" B", 8},
                                {"VAL_ 10 x 0 zero ;", 13},
                                {"VAL_ 10 absent 0 \"zero\" ;", 6},
                                {"SIG_VALTYPE_ 10 absent : 1;", 14},
                                {"CM_ BO_ 10 \"never closed;", 12},
                                {"CM_ BO_ 10 \"has \"quotes\" inside\" here;", 12},
                                {"what is this", 1},
                                {"\x01\x02(((", 1},
                                {"BO_X 1 A: 8 B", 1}};
  for (const Bad& bad : all) {
    INFO(bad.text);
    const Dbc dbc = parse_dbc(kBefore + bad.text + "\n" + kAfter);
    CHECK(rest_is_there(dbc));
    REQUIRE(dbc.problems.size() == 1);
    CHECK(dbc.problems[0].line == 3);
    CHECK(dbc.problems[0].column == bad.column);
    CHECK_FALSE(dbc.problems[0].text.empty());
  }
}

TEST_CASE("a message that was left out takes its own signals and names with it, quietly") {
  const Dbc dbc = parse_dbc(kBefore +
                            "BO_ 12 Large: 65 A\n SG_ a : 0|8@1+ (1,0) [0|0] \"\" B\n SG_ b : "
                            "8|8@1+ (1,0) [0|0] \"\" B\n" +
                            kAfter + "VAL_ 12 a 0 \"zero\" ;\nSIG_VALTYPE_ 12 b : 1;\n");
  CHECK(rest_is_there(dbc));
  CHECK(dbc.problems.size() == 1);
}

TEST_CASE("what says nothing about layouts is skipped without a word") {
  const Dbc dbc = parse_dbc(
      "VERSION \"HNPBNNYYNYNN\"\n\nNS_ :\n    NS_DESC_\n    CM_\n\tBA_DEF_\n\tVAL_\n\nBS_:\n\nBU_: "
      "A B C\n\n" +
      kBefore +
      "VAL_TABLE_ onoff 1 \"on; really\" 0 \"off\" ;\n"
      "BO_TX_BU_ 10 : A,B;\n"
      "EV_ Env: 0 [0|1] \"\" 0 1 DUMMY_NODE_VECTOR0 Vector__XXX;\n"
      "VAL_ Env 1 \"on\" 0 \"off\" ;\n"
      "CM_ \"a comment; with\nBO_ 77 Fake: 8 A\n SG_ z : 0|8@1+ (1,0) [0|0] \\\"\\\" B\nlines\";\n"
      "CM_ SG_ 10 x \"say \\\"hello\\\"; twice\";\n"
      "CM_ BU_ A \"no semicolon\"\n"
      "CM_ BO_ 10 \"he said \"yes\" to it\";\n"
      "BA_DEF_  \"Baudrate\" INT 0 1000000;\n"
      "BA_DEF_ SG_ \"GenSigStartValue\" FLOAT 0 0;\n"
      "BA_DEF_DEF_ \"Baudrate\" 500000;\n"
      "BA_ \"Baudrate\" 250000;\n"
      "BA_ \"GenMsgCycleTime\" BO_ 10 100;\n"
      "SIG_GROUP_ 10 Group 1 : x\n  ;\n"
      "BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX\n SG_ lost : 0|8@1+ (1,0) [0|0] "
      "\"\" Vector__XXX\n"
      "VAL_ 3221225472 lost 1 \"x\" ;\n" +
      kAfter);
  for (const DbcProblem& problem : dbc.problems)
    UNSCOPED_INFO(problem.line << ": " << problem.text);
  CHECK(dbc.problems.empty());
  CHECK(rest_is_there(dbc));
  CHECK(dbc.messages.size() == 2);
}

TEST_CASE("spaces, line ends, byte order mark and two files in one") {
  const std::string loose =
      "NS_  :\n  CM_\nBS_ :\nBO_  10  Before :  8  A\n\tSG_  x  :  0 | 8 @ 1 +  ( +1 , 0 )  [ "
      "-3.4E+038 | 3.4e38 ]  \"\"  B\n";
  const Dbc spaced = parse_dbc(loose + kAfter);
  CHECK(spaced.problems.empty());
  CHECK(rest_is_there(spaced));
  CHECK(spaced.find("Before")->find("x")->minimum == -3.4e38);

  std::string carriage;
  for (const char c : kBefore + "VAL_ 10 x 0 \"zero\"\n 1 \"one\" ;\n" + kAfter) {
    if (c == '\n') carriage += '\r';
    carriage += c;
  }
  const Dbc with_returns =
      parse_dbc(std::string("\xEF\xBB\xBF").append(carriage).append("bad\r\n"));
  CHECK(rest_is_there(with_returns));
  CHECK(with_returns.find("Before")->find("x")->value_names.size() == 2);
  CHECK(with_returns.find("Before")->find("x")->unit.empty());
  REQUIRE(with_returns.problems.size() == 1);
  CHECK(with_returns.problems[0].line == 8);
  CHECK(with_returns.problems[0].column == 1);

  std::string old = kBefore + kAfter;
  std::replace(old.begin(), old.end(), '\n', '\r');
  CHECK(rest_is_there(parse_dbc(old)));
  CHECK(rest_is_there(parse_dbc("VERSION \"\"\nBS_:\n" + kBefore +
                                "VERSION \"\"\nNS_ :\n\tCM_\n\nBS_:\n" + kAfter)));
  CHECK(parse_dbc("").messages.empty());
  CHECK(parse_dbc("BO_ 1 NoNewline: 8 A").messages.size() == 1);
  CHECK(parse_dbc("BO_ 1 1stDigit: 8 A\n").problems.empty());
}

TEST_CASE("an open quote takes no other statement with it") {
  for (const std::string open :
       {"CM_ \"open;\n", "VAL_ 10 x 0 \"open;\n", "VAL_TABLE_ t 0 \"open;\n", "BA_ \"open 1;\n",
        "BA_DEF_ BO_ \"open INT 0 1;\n"}) {
    INFO(open);
    const Dbc dbc = parse_dbc(kBefore + open + kAfter);
    CHECK(dbc.find("After") != nullptr);
  }
}

TEST_CASE("text of Windows-1252 becomes UTF-8, and UTF-8 stays") {
  const Dbc windows = parse_dbc(
      "BO_ 1 M: 8 A\n SG_ t : 0|8@1+ (1,0) [0|0] \"\xB0"
      "C\" B\n SG_ e : 8|8@1+ (1,0) [0|0] \"\x80\" B\n");
  CHECK(windows.problems.empty());
  CHECK(windows.messages.at(0).find("t")->unit ==
        "\xC2\xB0"
        "C");
  CHECK(windows.messages.at(0).find("e")->unit == "\xE2\x82\xAC");
  const Dbc unicode = parse_dbc(
      "BO_ 1 M: 8 A\n SG_ t : 0|8@1+ (1,0) [0|0] \"\xC2\xB0"
      "C\" B\n");
  CHECK(unicode.messages.at(0).find("t")->unit ==
        "\xC2\xB0"
        "C");
  CHECK(utf8_text("\xEF\xBB\xBFplain") == "plain");
  // Overlong, surrogate, beyond U+10FFFF, cut short: none is UTF-8.
  for (const std::string bytes :
       {"\xC0\x80", "\xED\xA0\x80", "\xF4\x90\x80\x80", "\xE2\x82", "\xF0\x80\x80\x80"}) {
    const std::string once = utf8_text(bytes);
    CHECK(once != bytes);
    CHECK(utf8_text(once) == once);
  }
  CHECK(utf8_text("\xF0\x9F\x9A\x97") == "\xF0\x9F\x9A\x97");
}

TEST_CASE("columns count characters") {
  const Dbc dbc = parse_dbc("BO_ 1 M: 8 A\n SG_ \xC3\xBC : 0|8@1+ (0,0) [0|0] \"\" B\n");
  REQUIRE(dbc.problems.size() == 1);
  CHECK(dbc.problems[0].line == 2);
  CHECK(dbc.problems[0].column == 18);
}

}  // namespace
}  // namespace holdfast
