// Writes valid inputs for a fuzzer to begin with: a folder for each target into the one named.

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "tests/support/message_types.h"
#include "tests/support/wire_sample.h"

namespace {

const std::filesystem::path kSource = HOLDFAST_SOURCE_DIR;

class Corpus {
 public:
  explicit Corpus(const std::filesystem::path& folder) : folder_(folder) {
    std::filesystem::create_directories(folder);
  }
  void add(const std::string& bytes) {
    std::ofstream file(folder_ / ("seed-" + std::to_string(num_files_++)), std::ios::binary);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }
  void add_file(const std::filesystem::path& file) {
    std::ifstream stream(file, std::ios::binary);
    add({std::istreambuf_iterator<char>(stream), {}});
  }

 private:
  std::filesystem::path folder_;
  int num_files_ = 0;
};

std::string flow_text(const YAML::Node& node) {
  YAML::Emitter emitter;
  emitter.SetSeqFormat(YAML::Flow);
  emitter.SetMapFormat(YAML::Flow);
  emitter << node;
  return emitter.c_str();
}

// One input for each type and array length.
void add_messages(Corpus corpus) {
  char index = 0;
  holdfast::testing::for_each_message_type([&]<class Message>() {
    for (const int num_elements : {0, 1, 3}) {
      holdfast::testing::WireSample sample;
      holdfast::testing::append_fields(sample, *holdfast::layouts::of<Message>, num_elements);
      std::string bytes(1, index);
      bytes.append(sample.bytes.begin(), sample.bytes.end());
      corpus.add(bytes);
    }
    ++index;
  });
}

void add_dbc_files(Corpus corpus) {
  for (const char* folder : {"scenarios", "tests/support/dbc_files"}) {
    for (const auto& file : std::filesystem::directory_iterator(kSource / folder)) {
      if (file.path().extension() == ".dbc") corpus.add_file(file.path());
    }
  }
  for (const auto& file : std::filesystem::directory_iterator(kSource / "tests/fuzz/layouts"))
    corpus.add(YAML::LoadFile(file.path())["dbc_text"].as<std::string>());
}

// Those of the scenarios name messages that the target's layout has not: they are for the grammar.
void add_rules(Corpus rules, Corpus control) {
  const std::string file = kSource / "tests/fuzz/seeds.yaml";
  rules.add_file(file);
  const YAML::Node list = YAML::LoadFile(file)["attacks"];
  std::string requests;
  for (const YAML::Node& rule : list) {
    const std::string text = flow_text(rule);
    rules.add("attacks: [" + text + "]\n");
    const std::string name = rule["name"].as<std::string>();
    for (const char* what : {"add", "change"})
      requests += nlohmann::json{{"do", what}, {"rule", text}}.dump() + "\n";
    requests += nlohmann::json{{"do", "pause"}, {"name", name}}.dump() + "\n";
    control.add(requests + nlohmann::json{{"do", "remove"}, {"name", name}}.dump() + "\n");
    requests.clear();
  }
  control.add(nlohmann::json{{"do", "swap"}, {"rules", flow_text(list)}}.dump() +
              "\n{\"do\":\"pause\"}\n{\"do\":\"resume\"}\n{\"do\":\"list\"}\n"
              "{\"do\":\"watch\",\"timeout_s\":5}\n{\"do\":\"ping\"}\n");
  for (const auto& entry : std::filesystem::directory_iterator(kSource / "scenarios")) {
    if (entry.path().extension() != ".yaml") continue;
    YAML::Node document;
    document["attacks"] = YAML::LoadFile(entry.path())["attacks"];
    rules.add(flow_text(document) + "\n");
  }
}

void add_lines(Corpus candump, Corpus slcan) {
  candump.add(
      "(1700000000.123456) can0 123#DEADBEEF\n(1700000000.123456789) vcan0 1FFFFFFF#11.22 R\n"
      "(1.000000) can1 123#R4 T\n(1.000000) can1 7FF##3001122334455667788\n"
      "(2.000000) can1 00000001#1122334455667788_F\n(3.000000) c 20000004#0001000000000000\n# "
      "no\n");
  slcan.add("t1232DEAD\rT1FFFFFFF0\r\nr1234\rR000000018\rd123900112233445566778899AABB\rz\rsa\r\a");
  slcan.add("b0018001122334455667788\rB0000000111230AF\re120\rV1013\rN1234\r\r" +
            std::string(170, 't') + "\rt0000\r");
}

// As python-can writes them.
void add_datagrams(Corpus udp) {
  for (const bool is_fd : {false, true}) {
    const std::vector<std::uint8_t> data(is_fd ? 12 : 3, 7);
    const nlohmann::ordered_json frame = {{"timestamp", 1.5},
                                          {"arbitration_id", 0x123},
                                          {"is_extended_id", false},
                                          {"is_remote_frame", false},
                                          {"is_error_frame", false},
                                          {"channel", nullptr},
                                          {"dlc", data.size()},
                                          {"data", nlohmann::ordered_json::binary(data)},
                                          {"is_fd", is_fd},
                                          {"bitrate_switch", is_fd},
                                          {"error_state_indicator", false}};
    const std::vector<std::uint8_t> bytes = nlohmann::ordered_json::to_msgpack(frame);
    udp.add({bytes.begin(), bytes.end()});
  }
}

// For each layout: readings or states of some steps and their ticks, checked and unchecked.
void add_steps(Corpus codec) {
  for (char layout = 0; layout < 4; ++layout) {
    for (const char mode : {char{2}, char{3}, char{0x33}, char{0}}) {
      std::string bytes = {layout, mode};
      for (char step = 0; step < 6; ++step) {
        for (char source = 0; source < 3; ++source)
          bytes += std::string{3, source} + std::string("\0\0\x80\x3f\0\0\0\x40", 8);
        for (char message = 0; message < 9; ++message)
          bytes += std::string{1, message} + std::string(8, step) + std::string{1};
        bytes += char{2};
      }
      codec.add(bytes);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: holdfast_fuzz_seeds FOLDER" << std::endl;
    return 2;
  }
  const std::filesystem::path folder = argv[1];
  add_messages(Corpus(folder / "lcm_guard"));
  add_dbc_files(Corpus(folder / "dbc"));
  add_rules(Corpus(folder / "rules"), Corpus(folder / "control"));
  add_lines(Corpus(folder / "candump"), Corpus(folder / "slcan"));
  add_datagrams(Corpus(folder / "udp"));
  add_steps(Corpus(folder / "codec"));
}
