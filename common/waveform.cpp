#include "common/waveform.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>

namespace holdfast {
namespace {

constexpr std::size_t kSamplesMax = 1'000'000;

// Angle within one turn, in [0, 2 pi).
double turned(double angle_rad) {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  const double rest = std::fmod(angle_rad, kTurn);
  return rest < 0.0 ? rest + kTurn : rest;
}

// Numbers, one a line; empty lines and comments (#) are skipped. A trouble begins with the place.
std::vector<double> read_samples(std::istream& stream, const std::string& place,
                                 std::string& trouble) {
  std::vector<double> samples;
  std::string line;
  for (int number = 1; std::getline(stream, line); ++number) {
    const std::size_t first = line.find_first_not_of(" \t\r");
    if (first == std::string::npos || line[first] == '#') continue;
    std::size_t used = 0;
    double value = NAN;
    try {
      value = std::stod(line.substr(first), &used);
    } catch (const std::exception&) {
      used = 0;
    }
    const bool is_whole =
        used > 0 && line.find_first_not_of(" \t\r,;", first + used) == std::string::npos;
    if (!is_whole || !std::isfinite(value)) {
      trouble = place + ":" + std::to_string(number) + ": must be one finite number";
      return {};
    }
    samples.push_back(value);
    if (samples.size() > kSamplesMax) {
      trouble = place + ": more than " + std::to_string(kSamplesMax) + " numbers";
      return {};
    }
  }
  if (samples.empty()) trouble = place + ": holds no number";
  return samples;
}

}  // namespace

void Waveform::read(ConfigurationMap& map, const std::string& folder, bool may_walk) {
  map.read_choice("waveform", kind,
                  {{"constant", Kind::kConstant},
                   {"sine", Kind::kSine},
                   {"cosine", Kind::kCosine},
                   {"square", Kind::kSquare},
                   {"sawtooth", Kind::kSawtooth},
                   {"ramp", Kind::kRamp},
                   {"samples", Kind::kSamples},
                   {"random_walk", Kind::kRandomWalk}});
  if (kind == Kind::kRandomWalk && !may_walk) {
    map.problem("waveform", "a random walk is no signal that everyone can work out from the step");
  }
  map.read("amplitude", amplitude);
  map.read("offset", offset);
  const bool is_periodic = kind == Kind::kSine || kind == Kind::kCosine || kind == Kind::kSquare ||
                           kind == Kind::kSawtooth;
  if (is_periodic) {
    map.read("frequency_radps", frequency_radps, kPositive);
    map.read("phase_rad", phase_rad);
  }
  if (kind != Kind::kSamples) return;
  if (map.has("file")) {
    std::string file, trouble;
    map.read("file", file);
    if (!map.may_read_file("file")) return;
    const std::string path = (std::filesystem::path(folder) / file).string();
    std::ifstream stream(path);
    if (stream) samples = read_samples(stream, path, trouble);
    if (!stream.is_open()) trouble = "cannot open " + path;
    if (!trouble.empty()) map.problem("file", trouble);
    map.forget("file");
    // As one text: a list of so many numbers would take hundreds of times its length to read.
    std::string text;
    for (const double sample : samples) text += shortest_text(sample) + "\n";
    map.resolve("samples", YAML::Node(text));
    return;
  }
  map.require("samples");
  if (std::string text; map.scalar_text("samples", text)) {
    std::string trouble;
    map.read("samples", text);
    std::istringstream stream(text);
    samples = read_samples(stream, "line", trouble);
    if (!trouble.empty()) map.problem("samples", trouble);
    return;
  }
  map.read("samples", samples);
  if (map.has("samples") && samples.empty()) map.problem("samples", "must hold a number");
}

double Waveform::value(std::int64_t step, double step_s, double walk) const {
  const double time_s = static_cast<double>(step) * step_s;
  const double angle_rad = frequency_radps * time_s + phase_rad;
  double unit = 1.0;
  switch (kind) {
    case Kind::kConstant:
      break;
    case Kind::kSine:
      unit = std::sin(angle_rad);
      break;
    case Kind::kCosine:
      unit = std::cos(angle_rad);
      break;
    case Kind::kSquare:
      unit = turned(angle_rad) < std::numbers::pi ? 1.0 : -1.0;
      break;
    case Kind::kSawtooth:
      unit = turned(angle_rad) / std::numbers::pi - 1.0;
      break;
    case Kind::kRamp:
      unit = time_s;
      break;
    case Kind::kRandomWalk:
      unit = walk;
      break;
    case Kind::kSamples: {
      const auto index = static_cast<std::size_t>(step);
      if (step < 0 || index >= samples.size()) return 0.0;
      unit = samples[index];
      break;
    }
  }
  return offset + amplitude * unit;
}

}  // namespace holdfast
