#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "common/program.h"
#include "tools/experiment.h"

namespace holdfast {

inline void add_owned_buses(CLI::App& app, std::vector<std::string>& buses) {
  app.add_option("--i-own-this-bus", buses,
                 "URL of a bus that is no virtual one and that you may write to (repeatable)")
      ->allow_extra_args(false);
}

/// Options that every live program has.
struct ProgramOptions {
  std::string scenario;
  std::vector<std::string> overrides;
  std::string lcm_url;
  std::vector<std::string> owned_buses;

  CLI::Option* add_scenario(CLI::App& app) {
    CLI::Option* option =
        app.add_option("--scenario,scenario", scenario, "Scenario file (YAML)")->required();
    app.add_option("--set", overrides, "Override a key: path.to.key=value (repeatable)")
        ->allow_extra_args(false);
    return option;
  }
  void add_lcm(CLI::App& app) {
    app.add_option("--lcm-url", lcm_url, "LCM URL [$LCM_DEFAULT_URL, else udpm with ttl=0]");
  }
  void add_owned_bus(CLI::App& app) { add_owned_buses(app, owned_buses); }
  Experiment load() const { return load_experiment(scenario, overrides); }
};

/// What every main does last: adds --version, parses, and runs the body. Returns the exit status: 0
/// after help, 2 for wrong use, else that of run_program().
inline int run_command_line(CLI::App& app, const std::string& name, int argc, char** argv,
                            const std::function<int()>& body) {
  app.set_version_flag("--version", version_line(name));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return run_program(name, body);
}

}  // namespace holdfast
