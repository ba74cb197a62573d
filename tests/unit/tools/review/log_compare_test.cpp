#include "tools/log_compare.h"

#include <bit>
#include <cmath>
#include <limits>
#include <regex>

#include "common/configuration_text.h"
#include "common/run_meta.h"
#include "tests/support/catch.h"
#include "tests/unit/tools/review/review_logs.h"
#include "tools/log_fields.h"

namespace holdfast {
namespace {

using namespace review_test;

// Four estimates on EST_A, changed by the test before they are written.
template <class Change>
void write_run(const std::string& file, Change change) {
  LogWriter log(file);
  write_meta(log);
  for (std::int64_t k = 1; k <= 4; ++k) {
    estimate_t estimate = make_estimate(k, {0.1 * static_cast<double>(k), -0.0});
    hypothesis_t hypothesis{};
    hypothesis.name = "clean";
    hypothesis.mean = {1.0, 2.0};
    hypothesis.num_states = 2;
    estimate.hypotheses = {hypothesis};
    estimate.num_hypotheses = 1;
    change(k, estimate);
    log.write_message("EST_A", 0, estimate);
  }
}

void no_change(std::int64_t, estimate_t&) {}

TEST_CASE("equal estimates are equal, whatever seq, log time and other channels say") {
  const TemporaryFolder folder;
  write_run(folder.file("a"), no_change);
  {
    LogWriter log(folder.file("b"));
    log.write("SOMETHING", 5, {1});
    write_status(log, "x", status_t::RUNNING, {});
    for (std::int64_t k = 1; k <= 4; ++k) {
      LogReader reader(folder.file("a"));
      LogEvent event;
      estimate_t estimate;
      while (reader.next(event)) {
        if (event.channel == "EST_A" && decode_guarded(event.data, estimate) && estimate.step == k)
          break;
      }
      estimate.measurement_seq = 900 + k;
      estimate.seq = 77;
      log.write_message("EST_A", 1234 + k, estimate);
    }
  }
  const CompareResult result = compare_logs(folder.file("a"), folder.file("b"));
  CHECK(result.is_equal);
  CHECK(result.compared == 4);
  CHECK(result.text().find("EST_A: 4 messages compared") != std::string::npos);
}

TEST_CASE("one bit in any field makes a difference with a name") {
  const TemporaryFolder folder;
  write_run(folder.file("a"), no_change);
  const auto differs = [&](const std::string& field, auto change) {
    write_run(folder.file("b"), [&](std::int64_t k, estimate_t& estimate) {
      if (k == 3) change(estimate);
    });
    const CompareResult result = compare_logs(folder.file("a"), folder.file("b"));
    CHECK_FALSE(result.is_equal);
    REQUIRE_FALSE(result.differences.empty());
    CHECK(result.differences[0].field == field);
    CHECK(result.differences[0].step == 3);
    CHECK(result.differences[0].channel == "EST_A");
    CHECK(result.differing == 1);
    return result.differences[0];
  };
  const FieldDifference last_bit =
      differs("mean[0]", [](estimate_t& e) { e.mean[0] = std::nextafter(e.mean[0], 1.0); });
  CHECK(last_bit.value_a != last_bit.value_b);
  CHECK(last_bit.value_a == "0.30000000000000004");
  differs("mean[1]", [](estimate_t& e) { e.mean[1] = 0.0; });  // -0 is not 0
  const FieldDifference nan = differs("mean[1]", [](estimate_t& e) { e.mean[1] = std::nan(""); });
  CHECK(nan.value_b.find("nan") != std::string::npos);
  differs("hypotheses[0].num_candidates",
          [](estimate_t& e) { e.hypotheses[0].num_candidates = 7; });
  differs("hypotheses[0].mean[1]", [](estimate_t& e) { e.hypotheses[0].mean[1] = 3.0; });
  const FieldDifference name =
      differs("hypotheses[0].name", [](estimate_t& e) { e.hypotheses[0].name = "\x1b[2J"; });
  CHECK(name.value_b == "'\\x1b[2J'");
  differs("outcome", [](estimate_t& e) { e.outcome = 2; });
  differs("utime", [](estimate_t& e) { e.utime = 1; });
  differs("num_innovation", [](estimate_t& e) {
    e.innovation = {1.0};
    e.num_innovation = 1;
  });
}

TEST_CASE("NaN equals the same NaN") {
  const TemporaryFolder folder;
  const auto with_nan = [](std::int64_t, estimate_t& e) { e.mean[0] = std::nan(""); };
  write_run(folder.file("a"), with_nan);
  write_run(folder.file("b"), with_nan);
  CHECK(compare_logs(folder.file("a"), folder.file("b")).is_equal);
}

TEST_CASE("a missing step, a missing channel and nothing at all are not equal") {
  const TemporaryFolder folder;
  write_run(folder.file("a"), no_change);
  {
    LogWriter log(folder.file("shorter"));
    LogReader reader(folder.file("a"));
    LogEvent event;
    for (int i = 0; i < 4 && reader.next(event); ++i)
      log.write(event.channel, event.utime, event.data);
    LogWriter more(folder.file("more"));
    LogReader again(folder.file("a"));
    while (again.next(event)) more.write(event.channel, event.utime, event.data);
    write_estimate(more, "EST_B", 1, {1.0});
    LogWriter empty(folder.file("empty"));
    write_meta(empty);
  }
  const CompareResult shorter = compare_logs(folder.file("a"), folder.file("shorter"));
  CHECK_FALSE(shorter.is_equal);
  CHECK(shorter.text().find("4 messages in A, 3 in B") != std::string::npos);
  const CompareResult more = compare_logs(folder.file("a"), folder.file("more"));
  CHECK_FALSE(more.is_equal);
  CHECK(more.text().find("EST_B stands only in B") != std::string::npos);
  const CompareResult empty = compare_logs(folder.file("empty"), folder.file("empty"));
  CHECK_FALSE(empty.is_equal);
  CHECK(empty.text().find("nothing was compared") != std::string::npos);
}

TEST_CASE("an estimator that only a campaign can have may be missing, no other may") {
  const TemporaryFolder folder;
  for (const char* channel : {"EST_UNCORRUPTED", "EST_NEGLECT"}) {
    write_run(folder.file("live"), no_change);
    {
      LogWriter log(folder.file("campaign"));
      LogReader reader(folder.file("live"));
      LogEvent event;
      while (reader.next(event)) log.write(event.channel, event.utime, event.data);
      write_estimate(log, channel, 1, {1.0});
    }
    const CompareResult result = compare_logs(folder.file("live"), folder.file("campaign"));
    CHECK(result.is_equal == (std::string(channel) == "EST_UNCORRUPTED"));
    CHECK(result.text().find(std::string(channel) + " stands only in B") != std::string::npos);
  }
}

TEST_CASE("what smoothing would give is named as that where it is missing") {
  const TemporaryFolder folder;
  write_run(folder.file("live"), no_change);
  {
    LogWriter log(folder.file("smoothed"));
    LogReader reader(folder.file("live"));
    LogEvent event;
    while (reader.next(event)) log.write(event.channel, event.utime, event.data);
    write_estimate(log, "SMOOTHED_A", 1, {1.0});
  }
  CompareOptions options;
  options.channels = ".*";
  const CompareResult result = compare_logs(folder.file("live"), folder.file("smoothed"), options);
  CHECK_FALSE(result.is_equal);
  CHECK(result.text().find("SMOOTHED_A stands only in B; holdfast-smoother makes it of a log") !=
        std::string::npos);
}

// A log with these RUN_META, and an estimate on each channel.
void write_log(const std::string& file, const std::vector<run_meta_t>& metas,
               const std::vector<std::string>& channels) {
  LogWriter log(file);
  for (run_meta_t meta : metas) log.write_message("RUN_META", 0, meta);
  for (const std::string& channel : channels) write_estimate(log, channel, 1, {1.0});
}

TEST_CASE("which channels only a campaign has is read of the scenario that is whole") {
  const TemporaryFolder folder;
  const RunMeta meta{"x", kScenario, 1, 0, ""};
  run_meta_t good = to_message(meta), damaged = good, huge = good;
  damaged.scenario[damaged.scenario.find("clean")] = 'C';
  huge.scenario = "x: [";
  for (std::size_t i = 0; i < kValuesMax; ++i) huge.scenario += "a,";
  huge.scenario += "]\n" + kScenario;
  huge.scenario_hash = "";
  write_log(folder.file("campaign"), {good}, {"EST_A", "EST_UNCORRUPTED"});
  const auto compare = [&](const std::vector<run_meta_t>& metas) {
    write_log(folder.file("live"), metas, {"EST_A"});
    return compare_logs(folder.file("campaign"), folder.file("live"));
  };
  CHECK(compare({good}).is_equal);
  CHECK(compare({damaged, good}).is_equal);
  CHECK_FALSE(compare({}).is_equal);
  const CompareResult refused = compare({huge});
  CHECK_FALSE(refused.is_equal);
  CHECK(refused.text().find("more than 50000 values") != std::string::npos);
}

TEST_CASE("steps that stand twice are told") {
  const TemporaryFolder folder;
  write_run(folder.file("a"), no_change);
  {
    LogWriter log(folder.file("twice"));
    for (int run = 0; run < 2; ++run) {
      LogReader reader(folder.file("a"));
      LogEvent event;
      while (reader.next(event)) log.write(event.channel, event.utime, event.data);
    }
  }
  const CompareResult result = compare_logs(folder.file("a"), folder.file("twice"));
  CHECK_FALSE(result.is_equal);
  CHECK(result.text().find("EST_A holds 4 steps more than once") != std::string::npos);
}

TEST_CASE("other channels are compared on request, without receive stamps") {
  const TemporaryFolder folder;
  const auto write_measurements = [&](const std::string& file, std::int64_t stamp, double value) {
    LogWriter log(folder.file(file));
    measurement_set_t set{};
    packet_t packet{};
    packet.receive_utime = stamp;
    packet.rx_index = 4;
    packet.values = {value};
    packet.num_values = 1;
    set.step = 1;
    set.packets = {packet};
    set.num_packets = 1;
    log.write_message("MEASUREMENT", 0, set);
    run_meta_t meta{};
    meta.utime = stamp;
    log.write_message("RUN_META", 0, meta);
  };
  write_measurements("a", 100, 1.0);
  write_measurements("b", 200, 1.0);
  write_measurements("c", 100, 2.0);
  CompareOptions options;
  options.channels = ".*";  // RUN_META is left out all the same
  CHECK(compare_logs(folder.file("a"), folder.file("b"), options).is_equal);
  const CompareResult different = compare_logs(folder.file("a"), folder.file("c"), options);
  REQUIRE(different.differences.size() == 1);
  CHECK(different.differences[0].field == "packets[0].values[0]");
  CHECK_FALSE(compare_logs(folder.file("a"), folder.file("b")).is_equal);  // no EST_ in either
  options.channels = "(";
  CHECK_THROWS_AS(compare_logs(folder.file("a"), folder.file("b"), options), UsageError);
}

TEST_CASE("hostile events are left out and told") {
  const TemporaryFolder folder;
  write_run(folder.file("a"), no_change);
  {
    LogWriter log(folder.file("b"));
    LogReader reader(folder.file("a"));
    LogEvent event;
    while (reader.next(event)) log.write(event.channel, event.utime, event.data);
    log.write("EST_A", 0, std::vector<std::uint8_t>(40, 0xff));
  }
  const CompareResult result = compare_logs(folder.file("a"), folder.file("b"));
  CHECK(result.is_equal);
  CHECK(result.text().find("1 events on EST_A are no messages of ours") != std::string::npos);
}

TEST_CASE("the list of integer fields is that of the .lcm files") {
  const std::regex field(R"(^\s*(int64_t|double)\s+(\w+))");
  int fields = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::string(HOLDFAST_SOURCE_DIR) + "/lcmtypes")) {
    if (entry.path().extension() != ".lcm") continue;
    std::ifstream stream(entry.path());
    for (std::string line; std::getline(stream, line);) {
      std::smatch match;
      if (!std::regex_search(line, match, field)) continue;
      ++fields;
      INFO(entry.path() << ": " << match[2]);
      CHECK(is_integer_field(match[2].str()) == (match[1] == "int64_t"));
    }
  }
  CHECK(fields > 30);
}

}  // namespace
}  // namespace holdfast
