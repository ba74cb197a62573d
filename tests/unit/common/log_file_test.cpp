#include "common/log_file.h"

#include <filesystem>
#include <fstream>
#include <holdfast/timing_t.hpp>
#include <lcm/lcm-cpp.hpp>
#include <sstream>

#include "common/errors.h"
#include "common/run_meta.h"
#include "tests/support/catch.h"
#include "tests/support/message_types.h"
#include "tests/support/temporary_folder.h"

namespace holdfast {
namespace {

using testing::TemporaryFolder;

constexpr std::size_t kHeaderBytes = 28;

std::string contents(const std::string& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

void put_contents(const std::string& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
}

// Five events on channel "CHANNEL" with 10 data bytes each: 45 bytes an event.
constexpr std::size_t kEventBytes = kHeaderBytes + 7 + 10;

std::string five_events(const TemporaryFolder& folder) {
  const std::string file = folder.file("five.lcm");
  {
    LogWriter writer(file);
    for (int i = 0; i < 5; ++i) {
      writer.write("CHANNEL", 1000 + i,
                   std::vector<std::uint8_t>(10, static_cast<std::uint8_t>(i)));
    }
  }
  return contents(file);
}

struct ReadBack {
  std::vector<std::int64_t> numbers;
  std::int64_t damaged_bytes = 0;
  bool tail_is_torn = false;
};

ReadBack read_back(const TemporaryFolder& folder, const std::string& bytes) {
  put_contents(folder.file("log.lcm"), bytes);
  LogReader reader(folder.file("log.lcm"));
  ReadBack result;
  LogEvent event;
  while (reader.next(event)) {
    CHECK(event.channel == "CHANNEL");
    CHECK(event.data == std::vector<std::uint8_t>(10, static_cast<std::uint8_t>(event.number)));
    CHECK(event.utime == 1000 + event.number);
    result.numbers.push_back(event.number);
  }
  CHECK_FALSE(reader.next(event));
  result.damaged_bytes = reader.damaged_bytes();
  result.tail_is_torn = reader.tail_is_torn();
  return result;
}

using Numbers = std::vector<std::int64_t>;

}  // namespace

TEST_CASE("a log is read as it was written, and its bytes follow LCM's format") {
  const TemporaryFolder folder;
  const std::string bytes = five_events(folder);
  REQUIRE(bytes.size() == 5 * kEventBytes);
  const std::string second = bytes.substr(kEventBytes, kEventBytes);
  CHECK(second == std::string("\xED\xA1\xDA\x01"
                              "\0\0\0\0\0\0\0\x01"
                              "\0\0\0\0\0\0\x03\xE9"
                              "\0\0\0\x07"
                              "\0\0\0\x0A"
                              "CHANNEL",
                              35) +
                      std::string(10, '\x01'));
  const ReadBack result = read_back(folder, bytes);
  CHECK(result.numbers == Numbers{0, 1, 2, 3, 4});
  CHECK(result.damaged_bytes == 0);
  CHECK_FALSE(result.tail_is_torn);
}

TEST_CASE("every torn tail is told, and costs its own event only") {
  const TemporaryFolder folder;
  const std::string bytes = five_events(folder);
  for (std::size_t size = 4 * kEventBytes + 1; size < 5 * kEventBytes; ++size) {
    INFO("cut to " << size);
    const ReadBack result = read_back(folder, bytes.substr(0, size));
    REQUIRE(result.numbers == Numbers{0, 1, 2, 3});
    REQUIRE(result.tail_is_torn);
    REQUIRE(result.damaged_bytes == 0);
  }
}

TEST_CASE("damage is skipped up to the next event, and counted") {
  const TemporaryFolder folder;
  const std::string bytes = five_events(folder);
  SECTION("a spoilt sync word") {
    std::string damaged = bytes;
    damaged[2 * kEventBytes + 1] = 'x';
    const ReadBack result = read_back(folder, damaged);
    CHECK(result.numbers == Numbers{0, 1, 3, 4});
    CHECK(result.damaged_bytes == static_cast<std::int64_t>(kEventBytes));
    CHECK_FALSE(result.tail_is_torn);
  }
  SECTION("noise between two events") {
    const std::string noise(1000, '\xED');
    const ReadBack result =
        read_back(folder, bytes.substr(0, 2 * kEventBytes) + noise + bytes.substr(2 * kEventBytes));
    CHECK(result.numbers == Numbers{0, 1, 2, 3, 4});
    CHECK(result.damaged_bytes == 1000);
    CHECK_FALSE(result.tail_is_torn);
  }
  SECTION("noise at the end") {
    const ReadBack result = read_back(folder, bytes + std::string(100, 'x'));
    CHECK(result.numbers == Numbers{0, 1, 2, 3, 4});
    CHECK(result.damaged_bytes == 100);
    CHECK_FALSE(result.tail_is_torn);
  }
  SECTION("nothing but noise") {
    const ReadBack result = read_back(folder, std::string(5000, 'x'));
    CHECK(result.numbers.empty());
    CHECK(result.damaged_bytes == 5000);
  }
}

TEST_CASE("a huge or negative length is damage, not memory") {
  const TemporaryFolder folder;
  const std::string bytes = five_events(folder);
  for (const std::size_t field : {20, 24}) {
    for (const std::string length : {"\x7F\xFF\xFF\xFF", "\xFF\xFF\xFF\xFF"}) {
      std::string damaged = bytes;
      damaged.replace(kEventBytes + field, 4, length);
      const ReadBack result = read_back(folder, damaged);
      CHECK(result.numbers == Numbers{0, 2, 3, 4});
      CHECK(result.damaged_bytes == static_cast<std::int64_t>(kEventBytes));
      CHECK_FALSE(result.tail_is_torn);
    }
  }
}

TEST_CASE("an empty log holds nothing, and a missing one is wrong use") {
  const TemporaryFolder folder;
  const ReadBack result = read_back(folder, "");
  CHECK(result.numbers.empty());
  CHECK_FALSE(result.tail_is_torn);
  CHECK_THROWS_AS(LogReader(folder.file("missing.lcm")), UsageError);
  CHECK_THROWS_AS(LogWriter(folder.file("no/such/folder.lcm")), JobError);
}

TEST_CASE("a log that is to appear when finished does so whole, or not at all") {
  const TemporaryFolder folder;
  const std::string file = folder.file("new.lcm");
  const auto write = [&](bool is_finished) {
    LogWriter writer(file, LogWriter::Appears::kWhenFinished);
    writer.write("CHANNEL", 0, std::vector<std::uint8_t>(10));
    CHECK(std::filesystem::exists(file + ".part"));
    if (is_finished) writer.finish();
  };
  for (const bool is_finished : {false, true}) {
    write(is_finished);
    CHECK(std::filesystem::exists(file) == is_finished);
    CHECK_FALSE(std::filesystem::exists(file + ".part"));
  }
  const std::string nowhere = folder.file("no/such/folder.lcm");
  CHECK_THROWS_WITH(LogWriter(nowhere, LogWriter::Appears::kWhenFinished),
                    Catch::StartsWith(nowhere + ": cannot be written"));
}

TEST_CASE("a log replaces no device, and nobody's file that happens to be called .part") {
  const TemporaryFolder folder;
  const std::string file = folder.file("new.lcm"), link = folder.file("full");
  put_contents(file + ".part", "somebody's");
  {
    LogWriter writer(file, LogWriter::Appears::kWhenFinished);
    writer.write("CHANNEL", 0, std::vector<std::uint8_t>(10));
    writer.finish();
  }
  CHECK(std::filesystem::file_size(file) > 10);
  CHECK(contents(file + ".part") == "somebody's");
  CHECK_FALSE(std::filesystem::exists(file + ".part1"));
  std::filesystem::create_symlink("/dev/full", link);
  {
    LogWriter writer(link, LogWriter::Appears::kWhenFinished);
    writer.write("CHANNEL", 0, std::vector<std::uint8_t>(10));
    CHECK_THROWS_AS(writer.finish(), JobError);
  }
  CHECK(std::filesystem::is_character_file(link));
}

TEST_CASE("a run's folder stands for its log") {
  const TemporaryFolder folder;
  CHECK(log_of_run(folder.file("run.lcm")) == folder.file("run.lcm"));
  CHECK_THROWS_AS(log_of_run(folder.file(".")), UsageError);
  put_contents(folder.file("log.lcm"), "");
  CHECK(log_of_run(folder.file(".")) == folder.file("./log.lcm"));
}

TEST_CASE("a full disk is told when the log is flushed") {
  LogWriter writer("/dev/full");
  writer.write("CHANNEL", 0, std::vector<std::uint8_t>(10));
  CHECK_THROWS_AS(writer.flush(), JobError);
}

TEST_CASE("LCM's own reader reads our log, and ours reads LCM's") {
  const TemporaryFolder folder;
  const std::string ours = folder.file("ours.lcm");
  {
    LogWriter writer(ours);
    timing_t timing{};
    for (int step = 1; step <= 3; ++step) {
      timing.step = step;
      writer.write_message("TIMING_A", 10 * step, timing);
    }
  }
  const std::string theirs = folder.file("theirs.lcm");
  {
    lcm::LogFile input(ours, "r");
    lcm::LogFile output(theirs, "w");
    REQUIRE(input.good());
    int num_events = 0;
    while (const lcm::LogEvent* event = input.readNextEvent()) {
      timing_t timing;
      REQUIRE(timing.decode(event->data, 0, event->datalen) == event->datalen);
      CHECK(timing.seq == num_events);
      CHECK(event->timestamp == 10 * timing.step);
      CHECK(event->channel == "TIMING_A");
      lcm::LogEvent copy = *event;
      output.writeEvent(&copy);
      ++num_events;
    }
    CHECK(num_events == 3);
  }
  CHECK(contents(ours) == contents(theirs));
}

TEST_CASE("a log's RUN_META gives its scenario back") {
  const TemporaryFolder folder;
  const std::string file = folder.file("run.lcm");
  {
    LogWriter writer(file);
    run_meta_t message = to_message(RunMeta{"name", "seed: 3\n", 3, 7, "portable"});
    CHECK(message.scenario_hash == scenario_hash("seed: 3\n"));
    CHECK(message.version == version_text());
    writer.write("RUN_META", 1, {1, 2, 3});  // a forged one does not count
    writer.write_message("RUN_META", 1, message);
  }
  const RunMeta meta = read_run_meta(file);
  CHECK(meta.name == "name");
  CHECK(meta.scenario == "seed: 3\n");
  CHECK(meta.seed == 3);
  CHECK(meta.run == 7);
  CHECK(meta.kernel == "portable");
  put_contents(folder.file("empty.lcm"), "");
  CHECK_THROWS_AS(read_run_meta(folder.file("empty.lcm")), UsageError);
}

TEST_CASE("the scenario's hash is FNV-1a and keeps its leading zeros") {
  CHECK(scenario_hash("") == "cbf29ce484222325");
  CHECK(scenario_hash("a") == "af63dc4c8601ec8c");
  CHECK(scenario_hash("foobar") == "85944171f73967e8");
}

}  // namespace holdfast
