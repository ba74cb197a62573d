#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <iostream>

#include "common/clock.h"
#include "tools/campaign.h"
#include "tools/program_options.h"

namespace {

// Progress with rate and time left, at most four times a second.
struct ProgressLine {
  std::int64_t started_ns = holdfast::monotonic_time_ns(), shown_ns = 0;

  void operator()(std::int64_t done, std::int64_t total) {
    const std::int64_t now_ns = holdfast::monotonic_time_ns();
    if (now_ns - shown_ns < 250'000'000 && done < total) return;
    shown_ns = now_ns;
    const double rate =
        static_cast<double>(done) / (static_cast<double>(now_ns - started_ns) * 1e-9);
    std::cerr << "\rrun " << done << " of " << total << ", " << static_cast<std::int64_t>(rate)
              << "/s, " << static_cast<std::int64_t>(static_cast<double>(total - done) / rate)
              << " s left   " << (done == total ? "\n" : "") << std::flush;
  }
};

// CLI11's own checks print a range that ends in 300 digits.
CLI::Validator whole_number(long least) {
  const std::string what =
      "a whole number of at least " + std::to_string(least) + " (and below 2^31)";
  return {[least, what](std::string& text) {
            char* end = nullptr;
            const long value = std::strtol(text.c_str(), &end, 10);
            const bool fits = !text.empty() && *end == '\0' && value >= least && value < (1L << 31);
            return fits ? std::string() : "'" + text + "' is not " + what;
          },
          "INT"};
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Runs a scenario many times in process, with the plant, codec, attacker and estimators of a "
      "live run."};
  app.footer(
      "Examples:\n"
      "  holdfast-campaign scenarios/binary_tracking.yaml --runs 400\n"
      "  holdfast-campaign scenarios/binary_radio.yaml --set estimators.secure.particles=200 "
      "--json out.json\n"
      "  holdfast-campaign scenarios/binary_tracking.yaml --log run0.lcm --run 0      (one run, as "
      "a log)");
  holdfast::ProgramOptions options;
  holdfast::CampaignOptions campaign;
  std::string json, log;
  std::uint32_t run = 0;
  options.add_scenario(app);
  auto* runs =
      app.add_option("--runs", campaign.num_runs, "Number of runs [campaign.runs of the scenario]")
          ->check(whole_number(1));
  auto* first_run = app.add_option("--first-run", campaign.first_run, "Index of the first run [0]")
                        ->check(whole_number(0));
  auto* threads = app.add_option("--threads", campaign.num_threads, "Threads [one per processor]")
                      ->check(whole_number(1));
  auto* json_option =
      app.add_option("--json", json, "Write the result, curves included, to this file");
  auto* log_option = app.add_option("--log", log, "Write one run as an LCM log instead")
                         ->excludes(runs, first_run, threads, json_option);
  app.add_option("--run", run, "Which run to write [0]")->needs(log_option);
  const int status = holdfast::parse_command_line(app, "holdfast-campaign", argc, argv);
  if (status >= 0) return status;
  return holdfast::run_program("holdfast-campaign", [&] {
    const holdfast::Experiment experiment = options.load();
    if (!log.empty()) {
      holdfast::write_run_log(experiment, run, log);
      return 0;
    }
    if (runs->count() == 0) campaign.num_runs = experiment.campaign_runs;
    for (const holdfast::EstimatorEntry& entry : experiment.estimators) {
      if (entry.is_outside())
        std::cerr << "holdfast-campaign: " << entry.name << " is an outside command: left out\n";
    }
    if (isatty(STDERR_FILENO) != 0) campaign.on_progress = ProgressLine{};
    const holdfast::CampaignResult result = holdfast::run_campaign(experiment, campaign);
    std::cout << holdfast::to_text(result);
    if (json.empty()) return 0;
    std::ofstream stream(json);
    stream << holdfast::to_json(result);
    stream.close();
    if (!stream) throw holdfast::JobError(json + ": cannot be written");
    return 0;
  });
}
