// dbc_dump FILE.dbc < LINES > JSON: decodes lines "identifier hexdata", the identifier in decimal
// as a DBC writes it (bit 31: 29-bit), one JSON object a line. For comparison with other decoders.
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <sstream>

#include "drivers/can/dbc.h"

namespace {

constexpr std::uint32_t kExtendedBit = 0x80000000U;

std::string json_number(double value) {
  // As Python's json module reads and writes them.
  if (std::isnan(value)) return "NaN";
  if (std::isinf(value)) return value < 0 ? "-Infinity" : "Infinity";
  char text[40];
  std::snprintf(text, sizeof text, "%.17g", value);
  return text;
}

std::string decoded(const holdfast::DbcMessage& message, const std::string& hex) {
  holdfast::CanFrame frame = message.empty_frame();
  if (hex.size() != frame.num_bytes * 2U) return "{\"error\": \"length\"}";
  for (std::size_t i = 0; i < frame.num_bytes; ++i) {
    frame.data[i] = static_cast<std::uint8_t>(std::stoi(hex.substr(2 * i, 2), nullptr, 16));
  }
  std::string json = "{";
  for (const holdfast::DbcSignal& signal : message.signals) {
    if (!message.carries(signal, frame.bytes())) continue;
    json += (json.size() > 1 ? ", \"" : "\"") + signal.name +
            "\": " + json_number(signal.unpack(frame.bytes()));
  }
  return json + "}";
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: dbc_dump FILE.dbc < LINES\n";
    return 2;
  }
  std::ifstream file(argv[1], std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  const holdfast::Dbc dbc = holdfast::parse_dbc(text.str());
  for (const holdfast::DbcProblem& problem : dbc.problems) {
    std::cerr << argv[1] << ":" << problem.line << ":" << problem.column << ": " << problem.text
              << "\n";
  }
  if (!file || !dbc.problems.empty()) return 1;
  std::uint32_t identifier = 0;
  std::string hex;
  for (std::string line; std::getline(std::cin, line);) {
    std::istringstream words(line);
    hex.clear();
    words >> identifier >> hex;
    const auto* message = dbc.find(identifier & ~kExtendedBit, (identifier & kExtendedBit) != 0);
    std::cout << (message == nullptr ? "{\"error\": \"unknown\"}" : decoded(*message, hex)) << "\n";
  }
}
