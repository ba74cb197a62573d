// What holdfast-dbc prints, reads and writes.
#include "tools/dbc_tool.h"

#include <fstream>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "common/errors.h"
#include "tests/support/catch.h"
#include "tests/support/temporary_folder.h"

namespace holdfast {
namespace {

const Dbc& vendor() {
  static const Dbc dbc = parse_dbc(R"dbc(VERSION ""
BU_: Tank
BO_ 256 Level: 4 Tank
 SG_ HIGH : 0|1@1+ (1,0) [0|1] "" Tank
 SG_ TEMP : 8|16@1- (0.1,-40) [-40|100] "degC" Tank
BO_ 2566848513 Wide: 8 Tank
 SG_ ALL : 0|64@1+ (1,0) [0|0] "" Tank
BO_ 304 Mux: 2 Tank
 SG_ WHICH M : 0|8@1+ (1,0) [0|255] "" Tank
 SG_ A m1 : 8|8@1+ (1,0) [0|255] "" Tank
 SG_ B m2 : 8|8@1+ (1,0) [0|255] "" Tank
BO_ 305 Narrow: 2 Tank
 SG_ WHICH M : 0|2@1+ (1,0) [0|3] "" Tank
 SG_ FAR m9 : 8|8@1+ (1,0) [0|255] "" Tank
BO_ 310 Below: 2 Tank
 SG_ SIDE M : 0|4@1- (1,0) [-8|7] "" Tank
 SG_ MIDDLE m15M : 4|4@1+ (1,0) [0|15] "" Tank
 SG_ LOW m1 : 8|8@1+ (1,0) [0|255] "" Tank
BO_ 306 Nested: 2 Tank
 SG_ PAGE M : 0|4@1+ (1,0) [0|15] "" Tank
 SG_ PART m1M : 4|4@1+ (1,0) [0|15] "" Tank
 SG_ DEEP m2 : 8|8@1+ (1,0) [0|255] "" Tank
 SG_ TOP m0 : 8|8@1+ (1,0) [0|255] "" Tank
BO_ 307 Signed: 8 Tank
 SG_ ALL : 0|64@1- (1,0) [0|0] "" Tank
BO_ 308 Halves: 8 Tank
 SG_ ALL : 0|64@1+ (0.5,0) [0|0] "" Tank
BO_ 309 Real: 8 Tank
 SG_ F : 0|32@1- (1,0) [-5|5] "" Tank
 SG_ NAMED : 32|2@1+ (1,0) [0|2] "" Tank
VAL_ 256 HIGH 0 "dry" 1 "wet, very" ;
VAL_ 309 NAMED 1 "one" 9 "nine" ;
VAL_ 307 ALL -9223372036854775807 "least but one" ;
SIG_VALTYPE_ 309 F : 1;
SG_MUL_VAL_ 310 LOW MIDDLE 1-1;
SG_MUL_VAL_ 306 DEEP PART 2-3, 7-7;
)dbc");
  return dbc;
}

std::string encoded(const std::string& message, const std::vector<std::string>& signals,
                    std::vector<std::string>* said = nullptr) {
  std::vector<std::string> remarks;
  const std::string text = encode_text(vendor(), message, signals, remarks);
  if (said != nullptr) *said = remarks;
  return text;
}

std::string problem_of(const std::string& message, const std::vector<std::string>& signals) {
  try {
    encoded(message, signals);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("a list shows messages, signals and names of values") {
  const std::string text = list_text(vendor());
  for (const char* part :
       {"100  Level  4 bytes  from Tank", "HIGH", "0|1 Intel", "8|16 Intel", "signed", "x 0.1 - 40",
        "-40..100", "degC", "0 dry, 1 wet, very", "18FF0001  Wide", "selects", "when 2"}) {
    INFO(text);
    CHECK(text.find(part) != std::string::npos);
  }
}

TEST_CASE("a recording becomes a table, and what it holds beside is counted") {
  std::istringstream log(
      "(1700000000.000100) can0 100#01F401FF\n"
      "# a remark\n"
      "(1700000000.000200) can0 130#0105\n"
      "(1700000000.000300) can1 130#0205\n"
      "(1700000000.000400) can0 18FF0001#0000000000000080\n"
      "(1700000000.000500) can0 7FF#00\n"
      "(1700000000.000600) can0 100#01\n"
      "(1700000000.000700) can0 100#R\n"
      "(17000\n");
  std::ostringstream csv;
  const DecodeCounts counts = decode_to_csv(vendor(), log, csv);
  CHECK(csv.str() ==
        "time_s,interface,identifier,message,signal,value,unit,name\n"
        "1700000000.000100,can0,100,Level,HIGH,1,,\"wet, very\"\n"
        "1700000000.000100,can0,100,Level,TEMP,10,degC,\n"
        "1700000000.000200,can0,130,Mux,WHICH,1,,\n"
        "1700000000.000200,can0,130,Mux,A,5,,\n"
        "1700000000.000300,can1,130,Mux,WHICH,2,,\n"
        "1700000000.000300,can1,130,Mux,B,5,,\n"
        "1700000000.000400,can0,18FF0001,Wide,ALL,9223372036854775808,,\n");
  CHECK(counts.frames == 7);
  CHECK(counts.decoded == 4);
  CHECK(counts.unknown == 1);
  CHECK(counts.wrong_format == 2);
  CHECK(counts.broken_lines == 1);
}

TEST_CASE("a frame is written by names, numbers, and names of values") {
  CHECK(encoded("Level", {}) == "100#00000000");
  CHECK(encoded("Level", {"HIGH=wet, very", "TEMP=10"}) == "100#01F40100");
  CHECK(encoded("Wide", {"ALL=1"}) == "18FF0001#0100000000000000");
  // A multiplexer is set to what its signals need, or checked where it is given.
  CHECK(encoded("Mux", {"B=7"}) == "130#0207");
  CHECK(encoded("Mux", {"WHICH=1", "A=7"}) == "130#0107");
  CHECK(problem_of("Mux", {"A=1", "B=1"}).find("together") != std::string::npos);
  CHECK(problem_of("Mux", {"WHICH=1", "B=1"}).find("together") != std::string::npos);
  CHECK(problem_of("Narrow", {"FAR=1"}) ==
        "no frame of Narrow carries FAR: WHICH (2 bits, unsigned) would have to be 9");
  for (const char* signal : {"MIDDLE", "LOW"})
    CHECK(problem_of("Below", {std::string(signal) + "=1"}) ==
          "no frame of Below carries " + std::string(signal) +
              ": SIDE (4 bits, signed) would have to be 15");
  CHECK(problem_of("Level", {"HIGH=1", "HIGH=0"}).find("twice") != std::string::npos);
  CHECK(problem_of("Nobody", {}).find("Nobody") != std::string::npos);
  CHECK(problem_of("Level", {"LOW=1"}).find("LOW") != std::string::npos);
  CHECK(problem_of("Level", {"HIGH"}).find("NAME=VALUE") != std::string::npos);
  CHECK(problem_of("Level", {"HIGH=2"}).find("does not fit") != std::string::npos);
  CHECK(problem_of("Level", {"HIGH=damp"}).find("0 dry") != std::string::npos);
  CHECK(problem_of("Level", {"TEMP=1e99"}).find("does not fit") != std::string::npos);
}

TEST_CASE("selectors of selectors are listed, decoded, and set to what a signal needs") {
  const std::string text = list_text(vendor());
  for (const char* part :
       {"when PAGE 1; selects", "when PART 2-3, 7", "when PAGE 0", "when 9", "selects"}) {
    INFO(text);
    CHECK(text.find(part) != std::string::npos);
  }
  CHECK(encoded("Nested", {"DEEP=7"}) == "132#2107");
  CHECK(encoded("Nested", {"DEEP=7", "PART=7"}) == "132#7107");
  CHECK(encoded("Nested", {"TOP=7"}) == "132#0007");
  for (const std::vector<std::string>& signals : {std::vector<std::string>{"DEEP=7", "TOP=7"},
                                                  {"DEEP=7", "PART=4"},
                                                  {"DEEP=7", "PAGE=2"},
                                                  {"PART=2", "PAGE=0"}})
    CHECK(problem_of("Nested", signals).find("together") != std::string::npos);
  std::istringstream log(
      "(1.000000) can0 132#2107\n(1.000000) can0 132#2007\n(1.000000) can0 132#4107\n");
  std::ostringstream csv;
  decode_to_csv(vendor(), log, csv);
  CHECK(csv.str() ==
        "time_s,interface,identifier,message,signal,value,unit,name\n"
        "1.000000,can0,132,Nested,PAGE,1,,\n1.000000,can0,132,Nested,PART,2,,\n"
        "1.000000,can0,132,Nested,DEEP,7,,\n"
        "1.000000,can0,132,Nested,PAGE,0,,\n1.000000,can0,132,Nested,TOP,7,,\n"
        "1.000000,can0,132,Nested,PAGE,1,,\n1.000000,can0,132,Nested,PART,4,,\n");
}

TEST_CASE("whole numbers of 64 bits are written and read exactly where they are the bits") {
  const std::pair<const char*, std::vector<const char*>> cases[] = {
      {"Wide", {"0", "9007199254740993", "18446744073709551615", "100000"}},
      {"Signed", {"-1", "9007199254740993", "-9223372036854775808", "9223372036854775807"}}};
  for (const auto& [message, numbers] : cases) {
    for (const char* number : numbers) {
      std::vector<std::string> remarks;
      const std::string frame = encoded(message, {std::string("ALL=") + number}, &remarks);
      CHECK(remarks.empty());
      std::istringstream log("(1.000000) can0 " + frame + "\n");
      std::ostringstream csv;
      decode_to_csv(vendor(), log, csv);
      CHECK(csv.str().find(std::string(",ALL,") + number + ",,\n") != std::string::npos);
    }
  }
  CHECK(encoded("Signed", {"ALL=least but one"}) == "133#0100000000000080");
  CHECK(encoded("Wide", {"ALL=18446744073709551614"}) == "18FF0001#FEFFFFFFFFFFFFFF");
  for (const char* number : {"18446744073709551616", "-1", "1e20", "nan", "inf"})
    CHECK(problem_of("Wide", {std::string("ALL=") + number}).find("does not fit") !=
          std::string::npos);
  CHECK(problem_of("Signed", {"ALL=9223372036854775808"}).find("does not fit") !=
        std::string::npos);
  CHECK(problem_of("Real", {"NAMED=nine"}).find("nine does not fit its 2 bits") !=
        std::string::npos);
}

TEST_CASE("what a signal rounds, and what lies outside its limits, is said") {
  const auto remarks_of = [](const std::string& message, const std::string& signal) {
    std::vector<std::string> remarks;
    encoded(message, {signal}, &remarks);
    std::string text;
    for (const std::string& remark : remarks) text += remark + "\n";
    return text;
  };
  CHECK(remarks_of("Level", "HIGH=0.6") == "HIGH: 0.6 is written as 1 (raw 1)\n");
  CHECK(remarks_of("Level", "TEMP=10.04") == "TEMP: 10.04 is written as 10 (raw 500)\n");
  CHECK(remarks_of("Level", "TEMP=101.5") == "TEMP: 101.5 lies outside -40..100\n");
  CHECK(remarks_of("Real", "NAMED=3") == "NAMED: 3 lies outside 0..2\n");
  CHECK(remarks_of("Real", "F=-5.5") == "F: -5.5 lies outside -5..5\n");
  CHECK(remarks_of("Real", "F=nan") == "F: nan lies outside -5..5\n");
  CHECK(remarks_of("Wide", "ALL=9007199254740993.0") ==
        "ALL: 9007199254740993.0 is written as 9007199254740992 (raw 9007199254740992)\n");
  CHECK(remarks_of("Halves", "ALL=4503599627370497.5").find("(raw 9007199254740996)") !=
        std::string::npos);
  // Nothing is said of what the signal says as nearly as numbers are: not of a float's own rounding
  // and not of that of decimal fractions.
  for (int i = -400; i <= 1000; ++i)
    CHECK(remarks_of("Level", "TEMP=" + std::to_string(i / 10) +
                                  (i < 0 ? ".0" : "." + std::to_string(i % 10))) == "");
  CHECK(remarks_of("Real", "F=0.1") == "");
  CHECK(remarks_of("Wide", "ALL=1e3") == "");
  CHECK(remarks_of("Halves", "ALL=1.5") == "");
}

TEST_CASE("what a file says wrongly is told with its place, and the rest is read") {
  const testing::TemporaryFolder folder;
  std::ofstream(folder.file("bad.dbc"))
      << "BO_ 1 A: 1 X\n SG_ S : 0|1@1+ (1,0) [0|1] \"\" X\n SG_ T "
         ": nonsense\n";
  const Dbc dbc = load_dbc(folder.file("bad.dbc"));
  CHECK(problems_text(dbc, "bad.dbc").find("bad.dbc:3:") == 0);
  CHECK(dbc.messages.at(0).signals.size() == 1);
  CHECK_THROWS_AS(load_dbc(folder.file("none")), UsageError);
}

}  // namespace holdfast
