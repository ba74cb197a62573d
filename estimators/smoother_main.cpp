#include <unistd.h>

#include <cstdio>
#include <iostream>

#include "tools/log_fit.h"
#include "tools/log_smoother.h"
#include "tools/program_options.h"

namespace holdfast {
namespace {

// "run/log.lcm" becomes "run/log-smoothed.lcm".
std::string default_out(const std::string& log) {
  const std::string ending = ".lcm";
  const bool has_ending = log.size() > ending.size() && log.ends_with(ending);
  return (has_ending ? log.substr(0, log.size() - ending.size()) : log) + "-smoothed.lcm";
}

void show_progress(std::int64_t step, std::int64_t num_steps) {
  if (step % 1000 == 0) std::cerr << "\rstep " << step << " of " << num_steps << std::flush;
}

void show_round(const LogFitRound& round) {
  const AttackStatistics& s = round.statistics;
  std::printf("%5d %16.4f %8.4f %8.4f %8.4f %8.4f %8.4f %8.4f\n", round.round, round.log_likelihood,
              s.attack_probability, s.dos_probability, s.bias_probability, s.scale_probability,
              s.scale_mean, s.scale_std);
}

// What the log says of the attacks, as a block for the scenario.
AttackStatistics fit(const std::string& log, const std::string& name) {
  LogFitOptions options;
  options.log_file = log;
  options.name = name;
  options.on_round = show_round;
  std::printf("%5s %16s %8s %8s %8s %8s %8s %8s\n", "round", "log-likelihood", "attack", "dos",
              "bias", "scale", "mean", "std");
  const AttackStatistics fitted = fit_log(options).statistics;
  std::cout << "\nfor the scenario's estimator '" << name << "':\n" << assumes_text(fitted) << "\n";
  return fitted;
}

int smooth(LogSmootherOptions& options, const std::string& fitted_name) {
  if (!fitted_name.empty()) {
    options.statistics = fit(options.log_file, fitted_name);
    options.name = fitted_name;
  }
  if (options.out_file.empty()) options.out_file = default_out(options.log_file);
  const bool is_terminal = isatty(STDERR_FILENO) != 0;
  if (is_terminal) options.on_progress = show_progress;
  const std::int64_t count = smooth_log(options);
  if (is_terminal) std::cerr << "\r";
  std::cout << count << " smoothed estimates in " << options.out_file << "\n";
  return 0;
}

}  // namespace
}  // namespace holdfast

int main(int argc, char** argv) {
  CLI::App app{
      "Looks back over a log: runs the estimators of its scenario that have the key `smoother` on "
      "its measurements, smooths, and writes a log with SMOOTHED_<NAME> beside all that was "
      "there."};
  app.footer(
      "Examples:\n"
      "  holdfast-smoother run/log.lcm                        (writes run/log-smoothed.lcm)\n"
      "  holdfast-smoother run/log.lcm --name mixture --out mixture.lcm\n"
      "  holdfast-smoother run/log.lcm --lag 20               (each estimate by 20 later steps)\n"
      "  holdfast-smoother run/log.lcm --fit mixture          (learns what it assumes of attacks "
      "first)");
  holdfast::LogSmootherOptions options;
  std::string fitted_name;
  app.add_option("log", options.log_file, "LCM log of a run")->required();
  app.add_option("--out", options.out_file, "Log to write [LOG with -smoothed before its ending]");
  app.add_option("--name", options.name, "Only this estimator, with or without the key `smoother`");
  app.add_option("--fit", fitted_name,
                 "This estimator (method attack_mixture), with beliefs fitted to the log by "
                 "expectation-maximisation, which are printed")
      ->excludes("--name");
  app.add_option("--lag", options.lag_steps,
                 "Steps that an estimate may look ahead [the scenario's; 0: the whole run]")
      ->check(CLI::Range(std::int64_t{0}, std::int64_t{100000}));
  return holdfast::run_command_line(app, "holdfast-smoother", argc, argv,
                                    [&] { return holdfast::smooth(options, fitted_name); });
}
