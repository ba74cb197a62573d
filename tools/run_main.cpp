#include <unistd.h>

#include <filesystem>

#include "tools/launcher.h"
#include "tools/program_options.h"

int main(int argc, char** argv) {
  CLI::App app{"Runs a scenario live: plant, attacker, driver, estimators, log, results table."};
  app.footer(
      "Examples:\n"
      "  holdfast-run scenarios/binary_tracking.yaml\n"
      "  holdfast-run scenarios/binary_tracking.yaml --set seed=7 --set "
      "attacks.flip.probability=0.2");
  holdfast::LaunchOptions options;
  app.add_option("scenario,--scenario", options.scenario, "Scenario file (YAML)")->required();
  app.add_option("--set", options.overrides, "Override a key: path.to.key=value (repeatable)")
      ->allow_extra_args(false);
  app.add_option("--lcm-url", options.lcm_url, "LCM URL [a free port on loopback]");
  app.add_option("--runs", options.runs_folder, "Folder for the run's folder [runs]");
  app.add_option("--ready-timeout", options.ready_timeout_s,
                 "Seconds in which every process must say that it is ready [30]")
      ->check(CLI::Range(0.1, 1e6));
  app.add_option("--stall-timeout", options.stall_timeout_s,
                 "Seconds without a new step that end the run; at least five periods [20]")
      ->check(CLI::Range(0.1, 1e6));
  app.add_option("--control", options.control,
                 "Path of a local socket on which holdfast-control changes the attacker's rules");
  app.add_flag(
      "--dry-run", options.is_dry,
      "The attacker forwards all as it is and only says what it would do, on ATTACK_LABEL");
  holdfast::add_owned_buses(app, options.owned_buses);
  return holdfast::run_command_line(app, "holdfast-run", argc, argv, [&] {
    options.program_folder = std::filesystem::read_symlink("/proc/self/exe").parent_path().string();
    options.shows_progress = isatty(STDOUT_FILENO) != 0;
    return holdfast::launch(options);
  });
}
