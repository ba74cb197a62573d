#include <unistd.h>

#include <cstdio>
#include <iostream>

#include "common/log_file.h"
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
  if (step % 1000 == 0) std::cerr << "step " << step << " of " << num_steps << '\r' << std::flush;
}

void show_round(const LogFitRound& round) {
  if (round.round == 0) {
    for (const std::string& belief : round.unmoved) {
      std::cerr << "holdfast-smoother: " << belief
                << ": stays as the scenario guesses; docs/gslr.md says why\n";
    }
    std::printf("%5s %16s %8s %8s %8s %8s %10s %9s %9s\n", "round", "log-likelihood", "attack",
                "dos", "bias", "scale", "scale mean", "scale std", "change");
  }
  const AttackStatistics& s = round.statistics;
  std::printf("%5d %16.4f %8.4f %8.4f %8.4f %8.4f %10.4f %9.4f %9.1e\n", round.round,
              round.log_likelihood, s.attack_probability, s.dos_probability, s.bias_probability,
              s.scale_probability, s.scale_mean, s.scale_std, round.change);
  std::fflush(stdout);
}

// What the log says of the attacks, as a block for the scenario.
AttackStatistics fit(const LogFitOptions& options) {
  const LogFitRound last = fit_log(options);
  if (!last.is_converged) {
    std::cerr << "holdfast-smoother: stopped after round " << last.round
              << ", not converged: a belief still changes by " << last.change
              << " of its size. More rounds (--fit-rounds) suit this log better, the truth often "
                 "worse: see docs/gslr.md\n";
  }
  std::cout << "\nfor the scenario's estimator '" << options.name << "':\n"
            << assumes_text(last.statistics) << "\n";
  return last.statistics;
}

int smooth(LogSmootherOptions& options, LogFitOptions& fitted) {
  options.log_file = fitted.log_file = log_of_run(options.log_file);
  if (!fitted.name.empty()) {
    options.statistics = fit(fitted);
    options.name = fitted.name;
    options.program.clear();  // the fit has said it
  }
  if (options.out_file.empty()) options.out_file = default_out(options.log_file);
  const bool is_terminal = isatty(STDERR_FILENO) != 0;
  if (is_terminal) options.on_progress = show_progress;
  const std::int64_t count = smooth_log(options);
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
  holdfast::LogFitOptions fitted;
  fitted.on_round = holdfast::show_round;
  app.add_option("log", options.log_file, "LCM log of a run, or the run's folder")->required();
  app.add_option("--out", options.out_file, "Log to write [LOG with -smoothed before its ending]");
  app.add_option("--name", options.name, "Only this estimator, with or without the key `smoother`");
  auto* fit =
      app.add_option("--fit", fitted.name,
                     "This estimator (method attack_mixture), with beliefs fitted to the log by "
                     "expectation-maximisation, which are printed");
  fit->excludes("--name");
  app.add_option("--fit-rounds", fitted.rounds_max, "Rounds after which the fit stops")
      ->needs(fit)
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  app.add_option("--lag", options.lag_steps,
                 "Steps that an estimate may look ahead [the scenario's; 0: the whole run]")
      ->check(CLI::Range(std::int64_t{0}, std::int64_t{100000}));
  return holdfast::run_command_line(app, "holdfast-smoother", argc, argv,
                                    [&] { return holdfast::smooth(options, fitted); });
}
