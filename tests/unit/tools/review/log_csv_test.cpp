#include "tools/log_csv.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <map>
#include <sstream>

#include "tests/support/catch.h"
#include "tests/unit/tools/review/review_logs.h"

namespace holdfast {
namespace {

using namespace review_test;

// Rows of a CSV without line ends inside cells; quotes are taken off.
std::vector<std::vector<std::string>> read_csv(const std::string& file) {
  std::vector<std::vector<std::string>> rows;
  std::istringstream stream(read_file(file));
  for (std::string line; std::getline(stream, line);) {
    std::vector<std::string> cells(1);
    bool is_quoted = false;
    for (std::size_t i = 0; i < line.size(); ++i) {
      if (line[i] == '"' && is_quoted && line.substr(i, 2) == "\"\"") {
        cells.back() += line[i++];
      } else if (line[i] == '"') {
        is_quoted = !is_quoted;
      } else if (line[i] == ',' && !is_quoted) {
        cells.emplace_back();
      } else {
        cells.back() += line[i];
      }
    }
    rows.push_back(cells);
  }
  return rows;
}

std::string cell(const std::vector<std::vector<std::string>>& rows, std::size_t row,
                 const std::string& column) {
  const auto found = std::ranges::find(rows.at(0), column);
  REQUIRE(found != rows[0].end());
  return rows.at(row).at(static_cast<std::size_t>(found - rows[0].begin()));
}

TEST_CASE("doubles come back from a CSV to the bit, integers in full") {
  const TemporaryFolder folder;
  const std::vector<double> values = {0.1,
                                      -0.0,
                                      1.0 / 3.0,
                                      std::numeric_limits<double>::denorm_min(),
                                      -std::numeric_limits<double>::max(),
                                      std::numeric_limits<double>::infinity()};
  {
    LogWriter log(folder.file("log"));
    truth_t truth{};
    truth.step = std::numeric_limits<std::int64_t>::max();
    truth.mode = -3;
    truth.state = values;
    truth.state.push_back(std::nan(""));
    truth.num_states = static_cast<std::int32_t>(truth.state.size());
    log.write_message("PLANT_TRUTH", 123, truth);
  }
  const CsvExport result = write_channel_csv(folder.file("log"), folder.file("new/csv"));
  CHECK(result.files == std::vector<std::string>{"PLANT_TRUTH.csv"});
  CHECK(result.notes.empty());
  const auto rows = read_csv(folder.file("new/csv/PLANT_TRUTH.csv"));
  REQUIRE(rows.size() == 2);
  CHECK(rows[1].size() == rows[0].size());
  CHECK(cell(rows, 1, "log_utime") == "123");
  CHECK(cell(rows, 1, "step") == "9223372036854775807");
  CHECK(cell(rows, 1, "mode") == "-3");
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::string text = cell(rows, 1, "state[" + std::to_string(i) + "]");
    INFO(text);
    CHECK(std::bit_cast<std::uint64_t>(std::strtod(text.c_str(), nullptr)) ==
          std::bit_cast<std::uint64_t>(values[i]));
  }
  CHECK(cell(rows, 1, "state[6]") == "nan");
}

TEST_CASE("an array has the columns of its largest, and shorter ones leave cells empty") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("log"));
    write_estimate(log, "EST_A", 1, {1.0});
    write_estimate(log, "EST_A", 2, {1.0, 2.0, 3.0}, {5.0});
    write_estimate(log, "EST_A", 3, {});
  }
  write_channel_csv(folder.file("log"), folder.file("csv"));
  const auto rows = read_csv(folder.file("csv/EST_A.csv"));
  REQUIRE(rows.size() == 4);
  for (const auto& row : rows) CHECK(row.size() == rows[0].size());
  CHECK(cell(rows, 1, "mean[0]") == "1");
  CHECK(cell(rows, 1, "mean[2]").empty());
  CHECK(cell(rows, 2, "mean[2]") == "3");
  CHECK(cell(rows, 2, "covariance[0]") == "5");
  CHECK(cell(rows, 3, "mean[0]").empty());
  CHECK(cell(rows, 3, "step") == "3");
  CHECK(std::ranges::find(rows[0], "mean[3]") == rows[0].end());
}

TEST_CASE("lists of structs have a row for each element, with their message's numbers") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("log"));
    write_frames(log, "CAN_RX", {make_frame(0, 257, {1, 255}), make_frame(1, 258, {})});
    write_frames(log, "CAN_RX", {});
    measurement_set_t set{};
    set.step = 4;
    packet_t packet{};
    packet.source = 3;
    packet.values = {0.5};
    packet.num_values = 1;
    set.packets = {packet, packet};
    set.num_packets = 2;
    log.write_message("MEASUREMENT", 0, set);
    attack_frame_t attack = make_attack(attack_frame_t::ALTERED, 1, "flip");
    attack.original = make_frame(9, 300, {7});
    log.write_message("ATTACK_FRAME", 0, attack);
  }
  const CsvExport result = write_channel_csv(folder.file("log"), folder.file("csv"));
  CHECK(result.files == std::vector<std::string>{"ATTACK_FRAME.csv", "CAN_RX.csv",
                                                 "CAN_RX.frames.csv", "MEASUREMENT.csv",
                                                 "MEASUREMENT.packets.csv"});
  const auto messages = read_csv(folder.file("csv/CAN_RX.csv"));
  CHECK(messages.size() == 3);
  const auto frames = read_csv(folder.file("csv/CAN_RX.frames.csv"));
  REQUIRE(frames.size() == 3);
  CHECK(cell(frames, 2, "element") == "1");
  CHECK(cell(frames, 1, "identifier") == "257");
  CHECK(cell(frames, 1, "data[1]") == "255");
  CHECK(cell(frames, 2, "data[0]").empty());
  const auto packets = read_csv(folder.file("csv/MEASUREMENT.packets.csv"));
  REQUIRE(packets.size() == 3);
  CHECK(cell(packets, 2, "step") == "4");
  CHECK(cell(packets, 2, "values[0]") == "0.5");
  const auto attacks = read_csv(folder.file("csv/ATTACK_FRAME.csv"));
  CHECK(cell(attacks, 1, "rule") == "flip");
  CHECK(cell(attacks, 1, "original.identifier") == "300");
  CHECK(cell(attacks, 1, "original.data[0]") == "7");
}

TEST_CASE("foreign channels and refused messages come as bytes") {
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("log"));
    log.write("LCM_SELF_TEST", 5, {0x00, 0xab});
    log.write("EMPTY", 6, {});
    log.write("EST_A", 7, {1, 2, 3});
  }
  const CsvExport result = write_channel_csv(folder.file("log"), folder.file("csv"));
  CHECK(read_file(folder.file("csv/LCM_SELF_TEST.csv")) ==
        "log_event,log_utime,num_bytes,bytes\n0,5,2,0x00ab\n");
  CHECK(read_file(folder.file("csv/EMPTY.csv")) ==
        "log_event,log_utime,num_bytes,bytes\n1,6,0,0x\n");
  CHECK(read_file(folder.file("csv/EST_A.refused.csv")) ==
        "log_event,log_utime,verdict,num_bytes,bytes\n2,7,too_short,3,0x010203\n");
  CHECK(result.files.size() == 3);
  REQUIRE(result.notes.size() == 1);
  CHECK(result.notes[0].find("EST_A: 1 events") == 0);
}

TEST_CASE("text cannot be run as a formula, and stays one cell") {
  CHECK(csv_text("plain") == "plain");
  CHECK(csv_text("a,b") == "\"a,b\"");
  CHECK(csv_text("say \"x\"") == "\"say \"\"x\"\"\"");
  CHECK(csv_text("two\nlines") == "\"two\nlines\"");
  for (const char* text : {"=1+1", "+1", "-1", "@SUM(A1)"}) CHECK(csv_text(text)[0] == '\'');
  CHECK(csv_text("=HYPERLINK(\"x\")") == "\"'=HYPERLINK(\"\"x\"\")\"");
  CHECK(csv_text("\t=1") == "\\x09=1");  // a tab or a return in front does not help
  CHECK(csv_text("\x1b[31m") == "\\x1b[31m");
  CHECK(csv_text("") == "");
  CHECK(csv_text("a-1") == "a-1");
}

TEST_CASE("whatever a channel is called, its file stays in the folder") {
  CHECK(file_name_of_channel("EST_A-1") == "EST_A-1");
  CHECK(file_name_of_channel("../../x") == "%2E%2E%2F%2E%2E%2Fx");
  CHECK(file_name_of_channel("A.packets") != "A");
  CHECK(file_name_of_channel("%2E") != file_name_of_channel("."));
  const std::string long_a(999, '/'), long_b = long_a.substr(1) + "x";
  CHECK(file_name_of_channel(long_a).size() < 200);
  CHECK(file_name_of_channel(long_a) != file_name_of_channel(long_b));
  const TemporaryFolder folder;
  {
    LogWriter log(folder.file("log"));
    log.write("../../x", 0, {1});
    log.write(std::string("/\0a", 3), 0, {1});
    log.write(long_a, 0, {1});
  }
  CHECK(write_channel_csv(folder.file("log"), folder.file("csv")).files.size() == 3);
  const auto files = std::filesystem::directory_iterator(folder.file("csv"));
  CHECK(std::distance(begin(files), end(files)) == 3);
  CHECK_FALSE(std::filesystem::exists(folder.file("x.csv")));
  CHECK_THROWS_AS(write_channel_csv(folder.file("log"), folder.file("log/csv")), JobError);
  CHECK_THROWS_AS(write_channel_csv(folder.file("none"), folder.file("csv")), UsageError);
}

TEST_CASE("one long array among many short ones does not fill the disk") {
  const TemporaryFolder folder;
  constexpr int kRows = 2000;
  const std::vector<double> huge(10000, 1.0);
  {
    LogWriter log(folder.file("log"));
    for (int k = 1; k <= kRows; ++k) write_estimate(log, "EST_A", k, {1.0});
    write_estimate(log, "EST_A", kRows + 1, huge);
  }
  const CsvExport result = write_channel_csv(folder.file("log"), folder.file("csv"));
  REQUIRE(result.notes.size() == 1);
  CHECK(result.notes[0].find("values left out") != std::string::npos);
  // Every element of every row would be 20 MB of commas.
  CHECK(std::filesystem::file_size(folder.file("csv/EST_A.csv")) < 1'000'000);
  const auto rows = read_csv(folder.file("csv/EST_A.csv"));
  CHECK(rows.size() == kRows + 2);
  CHECK(cell(rows, kRows + 1, "mean[0]") == "1");
}

}  // namespace
}  // namespace holdfast
