// What holdfast-dbc prints, reads and writes.
#include "tools/dbc_tool.h"

#include <fstream>
#include <sstream>

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
VAL_ 256 HIGH 0 "dry" 1 "wet, very" ;
)dbc");
  return dbc;
}

std::string problem_of(const std::string& message, const std::vector<std::string>& signals) {
  try {
    encode_text(vendor(), message, signals);
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
  CHECK(encode_text(vendor(), "Level", {}) == "100#00000000");
  CHECK(encode_text(vendor(), "Level", {"HIGH=wet, very", "TEMP=10"}) == "100#01F40100");
  CHECK(encode_text(vendor(), "Wide", {"ALL=1"}) == "18FF0001#0100000000000000");
  // A multiplexer is set to what its signals need, or checked where it is given.
  CHECK(encode_text(vendor(), "Mux", {"B=7"}) == "130#0207");
  CHECK(encode_text(vendor(), "Mux", {"WHICH=1", "A=7"}) == "130#0107");
  CHECK(problem_of("Mux", {"A=1", "B=1"}).find("together") != std::string::npos);
  CHECK(problem_of("Mux", {"WHICH=1", "B=1"}).find("together") != std::string::npos);
  CHECK(problem_of("Narrow", {"FAR=1"}).find("9 does not fit its 2 bits") != std::string::npos);
  CHECK(problem_of("Level", {"HIGH=1", "HIGH=0"}).find("twice") != std::string::npos);
  CHECK(problem_of("Nobody", {}).find("Nobody") != std::string::npos);
  CHECK(problem_of("Level", {"LOW=1"}).find("LOW") != std::string::npos);
  CHECK(problem_of("Level", {"HIGH"}).find("NAME=VALUE") != std::string::npos);
  CHECK(problem_of("Level", {"HIGH=2"}).find("does not fit") != std::string::npos);
  CHECK(problem_of("Level", {"HIGH=damp"}).find("0 dry") != std::string::npos);
  CHECK(problem_of("Level", {"TEMP=1e99"}).find("does not fit") != std::string::npos);
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
