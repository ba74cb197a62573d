#include <iostream>

#include "tools/mode_check.h"
#include "tools/program_options.h"

namespace holdfast {
namespace {

constexpr const char* kExamples =
    "Examples:\n"
    "  holdfast-check scenarios/three_area.yaml\n"
    "  holdfast-check scenarios/attack_locations.yaml --attacked-most 5\n"
    "  holdfast-check scenario.yaml --json\n"
    "Exit status: 0 whatever it finds, 1 with --strict when there is a warning, 2 wrong use or "
    "wrong "
    "file.";

int run(const ProgramOptions& options, const ModeCheckOptions& check_options, bool is_json,
        bool is_strict) {
  const Experiment experiment = options.load();
  const ModeCheck check = check_modes(experiment, check_options);
  std::cout << (is_json ? to_json(check) : to_text(check));
  return is_strict && !warnings_of(check).empty() ? 1 : 0;
}

}  // namespace
}  // namespace holdfast

int main(int argc, char** argv) {
  CLI::App app{
      "Tells before any run which attacks of a scenario can be corrected, and which modes can be "
      "told apart."};
  app.footer(holdfast::kExamples);
  holdfast::ProgramOptions options;
  holdfast::ModeCheckOptions check_options;
  bool is_json = false, is_strict = false;
  options.add_scenario(app);
  app.add_option("--attacked-most", check_options.attacked_most,
                 "Channels attacked at once [the most that a mode lists]")
      ->check(CLI::Range(0, 32));
  app.add_option("--steps", check_options.num_steps, "Steps over which modes are compared")
      ->check(CLI::Range(50, 100000))
      ->capture_default_str();
  std::string likelihood = "paper";
  app.add_option("--likelihood", likelihood,
                 "By which modes are compared; flat or evidence where they differ in number of "
                 "channels")
      ->check(CLI::IsMember({"paper", "ortho", "flat", "evidence"}))
      ->capture_default_str();
  app.add_option("--input-std", check_options.input_std, "Of unknown inputs, for evidence")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_flag("--json", is_json, "Print JSON instead");
  app.add_flag("--strict", is_strict, "Exit 1 when there is a warning");
  return holdfast::run_command_line(app, "holdfast-check", argc, argv, [&] {
    using holdfast::InputLikelihood;
    check_options.likelihood = likelihood == "paper"   ? InputLikelihood::kPaper
                               : likelihood == "ortho" ? InputLikelihood::kOrtho
                               : likelihood == "flat"  ? InputLikelihood::kFlat
                                                       : InputLikelihood::kEvidence;
    return holdfast::run(options, check_options, is_json, is_strict);
  });
}
