#include "tools/offline_attack.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>

#include "drivers/can/candump_log.h"
#include "tests/support/catch.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/tools/experiment/scenario_texts.h"
#include "tools/simulation.h"

namespace holdfast {
namespace {

constexpr const char* kSteps = "steps=40";

std::vector<CanFrame> frames_of(const std::string& file) {
  std::vector<CanFrame> frames;
  std::ifstream stream(file);
  CandumpRecord record;
  for (std::string line; std::getline(stream, line);) {
    REQUIRE(parse_candump_line(line, record) == CandumpLine::kFrame);
    frames.push_back(record.frame);
  }
  return frames;
}

std::string text_of(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

bool are_same(const std::vector<CanFrame>& a, const std::vector<CanFrame>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const CanFrame& x, const CanFrame& y) { return x.same_on_wire(y); });
}

struct Played {
  std::vector<CanFrame> frames, commands;
  std::vector<AttackRecord> records;
};

Played play(const Experiment& experiment) {
  Simulation simulation(experiment, 0);
  Played played;
  const auto append = [](auto& all, const auto& some) {
    all.insert(all.end(), some.begin(), some.end());
  };
  while (simulation.advance()) {
    append(played.frames, simulation.sent_frames());
    append(played.commands, simulation.commands());
    append(played.records, simulation.attack_records());
    append(played.records, simulation.command_records());
  }
  return played;
}

// What the plant sends, as candump -L would record it.
void record_plant(const std::string& scenario, const std::string& file) {
  std::ofstream stream(file);
  std::int64_t time_ns = 1'000'000'000;
  for (const CanFrame& frame : play(load_experiment(scenario, {kSteps, "attacks=[]"})).frames)
    stream << format_candump_line({time_ns += 1'000'000, "can0", frame}) << '\n';
}

}  // namespace

TEST_CASE("a recording is attacked to the byte as the live bus is, and the truth is written") {
  const testing::TemporaryFolder folder;
  const std::string in = folder.file("in.log"), out = folder.file("out.log"),
                    truth = folder.file("truth.jsonl"), commands = folder.file("c.log");
  const std::string scenario = testing::scenario("three_area");
  record_plant(scenario, in);
  const std::string rules =
      "attacks=[{name: open, match: {messages: [BreakerCommand]}, window: {last_step: 2}, action: "
      "inject, mode: '111', lead_steps: 1000}, {name: loss, match: {messages: [Area2]}, action: "
      "drop, chain: {to_bad: 0.3, to_good: 0.3}}, {name: lie, match: {messages: [Area1]}, action: "
      "add, signal: OMEGA, value: {distribution: random_walk, std: 1}}, {name: twice, match: "
      "{messages: [Area3]}, probability: 0.2, action: duplicate}, {name: extra, match: {messages: "
      "[Area3]}, probability: 0.3, action: inject, signals: [OMEGA, POWER], value: {distribution: "
      "normal, mean: 0, std: 1}}]";
  const Experiment experiment = load_experiment(scenario, {kSteps, rules});
  const std::string text = attack_offline(experiment, {in, out, truth, commands});
  const Played live = play(experiment);
  CHECK(are_same(frames_of(out), live.frames));
  CHECK(are_same(frames_of(commands), live.commands));
  CHECK(live.commands.size() == 2);
  CHECK(text.find("frames read 160") != std::string::npos);

  std::ifstream stream(truth);
  std::vector<nlohmann::json> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(nlohmann::json::parse(line));
  REQUIRE(lines.size() == live.records.size());
  std::map<std::string, int> classes;
  for (const nlohmann::json& line : lines) {
    ++classes[line["class"]];
    CHECK(line["actions"] == nlohmann::json::array({line["action"]}));
    const auto is_same = [&line, &experiment](const AttackRecord& record) {
      return experiment.rules[record.rule].name == line["rule"] &&
             record.tx_index == line["tx_index"] && record.rx_index == line["rx_index"] &&
             record.step == line["step"] && record.draw == line["draw"];
    };
    CHECK(std::any_of(live.records.begin(), live.records.end(), is_same));
  }
  CHECK(classes["alteration"] == 40);
  CHECK(classes["suspension"] > 0);
  CHECK(classes["fabrication"] > 2);
  CHECK(classes["replay"] > 0);

  // Again: the same bytes; with another seed: others. Nothing is written over.
  const std::string again = folder.file("again.log"), other = folder.file("other.log");
  attack_offline(experiment, {in, again, "", ""});
  attack_offline(load_experiment(scenario, {kSteps, rules, "seed=2"}), {in, other, "", ""});
  CHECK(text_of(again) == text_of(out));
  CHECK(text_of(other) != text_of(out));
  CHECK_THROWS_AS(attack_offline(experiment, {in, out, "", ""}), UsageError);
  // Nor is anything made when one of the files cannot be.
  CHECK_THROWS_AS(attack_offline(experiment, {in, folder.file("new.log"), truth, ""}), UsageError);
  CHECK_FALSE(std::filesystem::exists(folder.file("new.log")));
  CHECK_THROWS_AS(attack_offline(experiment, {in + "x", folder.file("y"), "", ""}), UsageError);
}

TEST_CASE("a recording may begin in the middle of a run, and a tick that is missing is told") {
  const testing::TemporaryFolder folder;
  const std::string in = folder.file("in.log"), out = folder.file("out.log"),
                    truth = folder.file("truth.jsonl"), gap = folder.file("gap.log");
  const Experiment experiment = load_experiment(
      testing::scenario("three_area"),
      {kSteps,
       "attacks=[{name: r, window: {first_step: 186}, match: {identifier: 0x123}, action: drop}]"});
  {
    std::ofstream stream(in), other(gap);
    for (int step = 185; step <= 188; ++step) {
      char tick[32];
      std::snprintf(tick, sizeof tick, "7F0#%02X000000", step);
      for (const std::string& frame : {std::string("123#11"), std::string(tick)}) {
        stream << "(1700000000.000000) can0 " << frame << '\n';
        if (frame != "7F0#BA000000") other << "(1700000000.000000) can0 " << frame << '\n';
      }
    }
  }
  const std::string text = attack_offline(experiment, {in, out, truth, ""});
  CHECK(text.find("steps 4 ") != std::string::npos);
  CHECK(text.find("dropped 3") != std::string::npos);
  CHECK(text.find("warning") == std::string::npos);
  CHECK(text_of(truth).find("\"step\":186") != std::string::npos);
  const std::string warned = attack_offline(experiment, {gap, folder.file("g.log"), "", ""});
  CHECK(warned.find("2 ticks ended no step, the first one 7F0#BB000000 where that of step 186") !=
        std::string::npos);
}

TEST_CASE("what is no recording, and outputs of one name, are refused before anything is made") {
  const testing::TemporaryFolder folder;
  const std::string in = folder.file("in.log"), out = folder.file("out.log");
  const Experiment experiment =
      load_experiment(testing::scenario("three_area"), {kSteps, "attacks=[]"});
  for (const char* text : {"", "  can0  123   [1]  11\n", "holdfast: 1\n"}) {
    std::ofstream(in) << text;
    CHECK_THROWS_AS(attack_offline(experiment, {in, out, "", ""}), UsageError);
  }
  std::ofstream(in) << "(1.000000) can0 123#11\n";
  CHECK_THROWS_AS(attack_offline(experiment, {in, out, out, ""}), UsageError);
  CHECK_THROWS_AS(attack_offline(experiment, {in, out, "", folder.file("./out.log")}), UsageError);
  CHECK_FALSE(std::filesystem::exists(out));
}

TEST_CASE("a recording that begins at time 0 keeps its times") {
  const testing::TemporaryFolder folder;
  const std::string in = folder.file("in.log"), out = folder.file("out.log");
  std::ofstream(in) << "(0.000000) can0 123#11\n(0.000001) can0 123#12\n";
  attack_offline(load_experiment(testing::scenario("three_area"), {kSteps, "attacks=[]"}),
                 {in, out, "", ""});
  CHECK(text_of(out) == "(0000000000.000000) vcan0 123#11\n(0000000000.000001) vcan0 123#12\n");
}

TEST_CASE("without rules a recording comes out as it went in; what is no frame is told") {
  const testing::TemporaryFolder folder;
  const std::string in = folder.file("in.log"), out = folder.file("out.log");
  std::ofstream(in) << "(1.000000) can0 123#11\n(1.5) can0 broken\n"
                       "(2.000000) can1 20000004#0004000000000000\n"
                       "(3.000000) can0 00000123#R4\n(4.000000) can0 123##1AABB\n";
  const Experiment experiment =
      load_experiment(testing::scenario("three_area"), {kSteps, "attacks=[]"});
  const std::string text = attack_offline(experiment, {in, out, "", ""});
  CHECK(text_of(out) ==
        "(0000000001.000000) vcan0 123#11\n(0000000003.000000) vcan0 00000123#R4\n"
        "(0000000004.000000) vcan0 123##1AABB\n");
  CHECK(text.find("1 broken lines, 1 error frames") != std::string::npos);
  CHECK(text.find("no tick of the scenario") != std::string::npos);
}

TEST_CASE("a recording that begins very late in a run takes no longer for that") {
  ProxyCore plain = load_experiment(testing::scenario("ieee14"), {}).make_proxy(0);
  plain.begin_at(4'000'000'000);
  CHECK(plain.current_step() == 4'000'000'000);
  const Experiment stealthy = load_experiment(
      testing::scenario("turning_target"), {"attacks=[{name: push, match: {messages: [Position]}, "
                                            "action: add, signal: X, value: {value: "
                                            "1}, stealth: {residual_most: 2}}]",
                                            "estimators=[]"});
  ProxyCore proxy = stealthy.make_proxy(0);
  proxy.begin_at(4'000'000'000);
  CHECK(proxy.current_step() == 4'000'000'000);
}

}  // namespace holdfast
