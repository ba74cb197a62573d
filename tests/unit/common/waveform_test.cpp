#include "common/waveform.h"

#include <cmath>
#include <fstream>
#include <numbers>

#include "common/configuration_text.h"
#include "common/step_window.h"
#include "tests/support/catch.h"
#include "tests/support/temporary_folder.h"

using namespace holdfast;

namespace {

Waveform waveform_of(const std::string& yaml, const std::string& folder = "",
                     std::string* resolved = nullptr) {
  ConfigurationDocument document = ConfigurationDocument::from_text(yaml, "test.yaml");
  Waveform waveform;
  ConfigurationMap root = document.root();
  waveform.read(root, folder);
  document.finish();
  if (resolved != nullptr) *resolved = document.resolved_text();
  return waveform;
}

}  // namespace

TEST_CASE("each waveform has its closed form") {
  const double step_s = 0.01, w = 3.0;
  const auto at = [&](const std::string& kind, std::int64_t step) {
    return waveform_of("{waveform: " + kind + ", amplitude: 2, frequency_radps: 3, offset: 0.5}")
        .value(step, step_s);
  };
  for (const std::int64_t step : {0, 1, 50, 104, 105, 209, 210, 777}) {
    const double angle = w * static_cast<double>(step) * step_s;
    CHECK(at("sine", step) == Approx(0.5 + 2.0 * std::sin(angle)).margin(1e-12));
    CHECK(at("cosine", step) == Approx(0.5 + 2.0 * std::cos(angle)).margin(1e-12));
    // The square wave is the sign of the sine; the sawtooth rises with slope w / pi.
    CHECK(at("square", step) == 0.5 + (std::sin(angle) >= 0.0 ? 2.0 : -2.0));
    const double turns = angle / (2.0 * std::numbers::pi);
    CHECK(at("sawtooth", step) ==
          Approx(0.5 + 2.0 * (2.0 * (turns - std::floor(turns)) - 1.0)).margin(1e-12));
  }
  CHECK(waveform_of("{waveform: ramp, amplitude: -4, offset: 1}").value(25, step_s) ==
        Approx(1.0 - 4.0 * 0.25));
  CHECK(waveform_of("{amplitude: 0.2}").value(1000, step_s) == 0.2);
  CHECK(waveform_of("{waveform: sine, phase_rad: -7}").value(0, 1.0) == Approx(std::sin(-7.0)));
}

TEST_CASE("samples come from a file, stand in the resolved document, and end in zero") {
  const testing::TemporaryFolder folder;
  std::ofstream(folder.file("a.txt")) << "# amplitude\n1.5\n\n -2e-1,\n3;\n";
  std::string resolved;
  const Waveform waveform =
      waveform_of("{waveform: samples, file: a.txt, amplitude: 2}", folder.file(""), &resolved);
  CHECK(waveform.samples == std::vector<double>{1.5, -0.2, 3.0});
  CHECK(waveform.value(1, 1.0) == -0.4);
  CHECK(waveform.value(3, 1.0) == 0.0);
  CHECK(waveform.value(-1, 1.0) == 0.0);
  CHECK(resolved.find("file") == std::string::npos);
  CHECK(waveform_of(resolved).samples == waveform.samples);
}

TEST_CASE("more samples than a configuration may list come from a file, or as a text") {
  const testing::TemporaryFolder folder;
  std::ofstream file(folder.file("a.txt"));
  for (std::size_t i = 0; i < 2 * kValuesMax; ++i) file << 0.1 * static_cast<double>(i) << "\n";
  file.close();
  std::string resolved;
  const Waveform waveform =
      waveform_of("{waveform: samples, file: a.txt}", folder.file(""), &resolved);
  CHECK(waveform.samples.size() == 2 * kValuesMax);
  CHECK(waveform_of(resolved).samples == waveform.samples);
  CHECK(waveform_of("{waveform: samples, samples: \"1\\n2.5\"}").samples ==
        std::vector<double>{1.0, 2.5});
  CHECK_THROWS_WITH(waveform_of("{waveform: samples, samples: \"1\\n2 x\"}"),
                    Catch::Contains("samples: line:2: must be one finite number"));
}

TEST_CASE("a file that holds no samples is told, with its line") {
  const testing::TemporaryFolder folder;
  const auto problem = [&](const std::string& text) {
    std::ofstream(folder.file("a.txt")) << text;
    try {
      waveform_of("{waveform: samples, file: a.txt}", folder.file(""));
    } catch (const ConfigurationError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  CHECK(problem("").find("holds no number") != std::string::npos);
  CHECK(problem("1\n2 3\n").find(":2: must be one finite number") != std::string::npos);
  CHECK(problem("1\nnan\n").find(":2:") != std::string::npos);
  CHECK(problem("1\n1e999\n").find(":2:") != std::string::npos);
  CHECK_THROWS_AS(waveform_of("{waveform: samples, file: nowhere.txt}", folder.file("")),
                  ConfigurationError);
  CHECK_THROWS_AS(waveform_of("{waveform: samples}"), ConfigurationError);
  CHECK_THROWS_AS(waveform_of("{waveform: triangle}"), ConfigurationError);
  CHECK_THROWS_AS(waveform_of("{waveform: sine, frequency_radps: 0}"), ConfigurationError);
}
