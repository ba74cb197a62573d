// campaign_speed [RUNS [ROUNDS]]: how much of the bare filter's speed a whole campaign keeps.
// Prints both, side by side, in one run; the campaign simulates plant, bus and attacker, scores and
// stores as well. Each round is a process of its own: where the system puts the stacks moves either
// loop by several percent for as long as a process lives.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "common/clock.h"
#include "tools/campaign/campaign.h"
#include "tools/campaign/campaign_summary.h"
#include "tools/child_process.h"
#include "tools/simulation.h"

namespace holdfast {
namespace {

double seconds_since(std::int64_t started_ns) {
  return 1e-9 * static_cast<double>(monotonic_time_ns() - started_ns);
}

// Every measurement set of some runs, so that the bare loop does nothing but filter.
std::vector<std::vector<MeasurementSet>> record_sets(const Experiment& experiment, int num_runs) {
  std::vector<std::vector<MeasurementSet>> runs;
  for (int run = 0; run < num_runs; ++run) {
    Simulation simulation(experiment, static_cast<std::uint32_t>(run));
    auto& sets = runs.emplace_back();
    while (simulation.advance()) sets.push_back(simulation.measurements());
  }
  return runs;
}

double bare_steps_per_s(const Experiment& experiment,
                        const std::vector<std::vector<MeasurementSet>>& runs, int num_passes) {
  const Eigen::VectorXd no_input;
  const std::int64_t started_ns = monotonic_time_ns();
  double num_steps = 0.0, sum = 0.0;
  for (int pass = 0; pass < num_passes; ++pass) {
    for (std::size_t run = 0; run < runs.size(); ++run) {
      const auto filter =
          experiment.make_estimator(experiment.estimators[0], static_cast<std::uint32_t>(run));
      for (const MeasurementSet& set : runs[run]) {
        sum += filter->step(set.step, set, no_input).mean[0];
        ++num_steps;
      }
    }
  }
  if (sum == 0.5) std::puts("");  // the sum is used, so the loop stays
  return num_steps / seconds_since(started_ns);
}

double bare_on_all(const Experiment& experiment,
                   const std::vector<std::vector<MeasurementSet>>& runs, int num_passes,
                   int num_threads) {
  std::vector<double> rates(static_cast<std::size_t>(num_threads));
  std::vector<std::thread> threads;
  for (double& rate : rates)
    threads.emplace_back([&] { rate = bare_steps_per_s(experiment, runs, num_passes); });
  for (std::thread& thread : threads) thread.join();
  double sum = 0.0;
  for (const double rate : rates) sum += rate;
  return sum;
}

double campaign_steps_per_s(const std::string& scenario, const std::vector<std::string>& overrides,
                            std::int64_t num_runs, int num_threads) {
  CampaignPlan plan = load_campaign_plan(scenario, overrides, {});
  plan.num_runs = num_runs;
  const std::string file =
      (std::filesystem::temp_directory_path() / "holdfast-campaign-speed.sqlite").string();
  std::filesystem::remove(file);
  const std::int64_t started_ns = monotonic_time_ns();
  {
    CampaignStore store(file, plan);
    ProcessGroup group;
    CampaignOptions options;
    options.num_threads = num_threads;
    run_campaign(plan, store, group, options);
  }
  const double seconds = seconds_since(started_ns);
  std::filesystem::remove(file);
  return static_cast<double>(num_runs * plan.points[0].experiment.num_steps) / seconds;
}

// Rates of one round, one loop after the other.
struct Round {
  double one, all, campaign;
};

std::string scenario_file() {
  return std::string(HOLDFAST_SOURCE_DIR) + "/scenarios/binary_tracking.yaml";
}

const std::vector<std::string>& overrides() {
  static const std::vector<std::string> kOverrides = {
      "estimators=[{name: secure, method: secure_particle_filter, particles: 500, "
      "packet_posteriors: false}]"};
  return kOverrides;
}

Round measure(std::int64_t num_runs, bool is_backwards) {
  const Experiment experiment = load_experiment(scenario_file(), overrides());
  const int num_cores = default_threads(ProcessGroup());
  const auto sets = record_sets(experiment, 20);
  const int num_passes = static_cast<int>(std::max<std::int64_t>(1, num_runs / 40));
  Round round{};
  const std::array<std::function<void()>, 3> loops = {
      [&] { round.one = bare_steps_per_s(experiment, sets, num_passes); },
      [&] { round.all = bare_on_all(experiment, sets, num_passes, num_cores); },
      [&] {
        round.campaign = campaign_steps_per_s(scenario_file(), overrides(), num_runs, num_cores);
      }};
  for (std::size_t j = 0; j < loops.size(); ++j) loops[is_backwards ? loops.size() - 1 - j : j]();
  return round;
}

// False when the process did not say three rates.
bool measure_in_process(const std::string& command, Round& round) {
  const std::unique_ptr<FILE, int (*)(FILE*)> output(popen(command.c_str(), "r"), pclose);
  return output &&
         std::fscanf(output.get(), "%lf %lf %lf", &round.one, &round.all, &round.campaign) == 3;
}

// Over the rounds; error: of the mean.
struct Spread {
  double mean, error, median;
};

template <class Value>
Spread spread_over(const std::vector<Round>& rounds, const Value& value) {
  const auto count = static_cast<double>(rounds.size());
  std::vector<double> values;
  double sum = 0.0, squares = 0.0;
  for (const Round& round : rounds) values.push_back(value(round));
  for (const double it : values) sum += it;
  const double mean = sum / count;
  for (const double it : values) squares += (it - mean) * (it - mean);
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  const double median =
      values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
  return {mean, count < 2.0 ? 0.0 : std::sqrt(squares / (count - 1.0) / count), median};
}

template <class Value>
void print_row(const char* text, const std::vector<Round>& rounds, double num_cores,
               const Value& rate, const char* remark) {
  const Spread speed = spread_over(rounds, rate);
  const Spread share = spread_over(
      rounds, [&](const Round& round) { return rate(round) / (round.one * num_cores); });
  std::printf("%-44s %12.0f %8.3f (%.3f) %8.3f%s\n", text, speed.mean, share.mean, share.error,
              share.median, remark);
}

int run(std::int64_t num_runs, int num_rounds) {
  const Experiment experiment = load_experiment(scenario_file(), overrides());
  const int num_cores = default_threads(ProcessGroup());
  std::printf("Sec-PF, M = 500, %ld steps, %ld runs, kernel %s, %d cores, %d rounds\n",
              static_cast<long>(experiment.num_steps), static_cast<long>(num_runs),
              experiment.kernel_text().c_str(), num_cores, num_rounds);
  std::fflush(stdout);
  // What a loop reaches changes with the moment, so shares are taken within a round, every second
  // one backwards, and averaged.
  const std::string program =
      shell_quoted(std::filesystem::read_symlink("/proc/self/exe").string());
  std::vector<Round> rounds(static_cast<std::size_t>(num_rounds));
  for (std::size_t i = 0; i < rounds.size(); ++i) {
    const std::string command =
        program + (i % 2 == 0 ? " --forwards " : " --backwards ") + std::to_string(num_runs);
    if (!measure_in_process(command, rounds[i])) {
      std::fprintf(stderr, "round %zu failed: %s\n", i + 1, command.c_str());
      return 1;
    }
  }
  std::printf("%-44s %12s %8s (%s) %8s\n", "", "steps/s", "share", "s.e.", "median");
  print_row(
      "bare filter loop, one thread, times the cores", rounds, num_cores,
      [num_cores](const Round& round) { return round.one * num_cores; }, "");
  print_row(
      "bare filter loop, on all cores at once", rounds, num_cores,
      [](const Round& round) { return round.all; }, "");
  print_row(
      "holdfast-campaign, everything included", rounds, num_cores,
      [](const Round& round) { return round.campaign; }, "   goal: 0.90");
  return 0;
}

int run_round(std::int64_t num_runs, bool is_backwards) {
  const Round round = measure(num_runs, is_backwards);
  std::printf("%.17g %.17g %.17g\n", round.one, round.all, round.campaign);
  return 0;
}

}  // namespace
}  // namespace holdfast

int main(int argc, char** argv) {
  const std::string first = argc > 1 ? argv[1] : "1000";
  const bool is_backwards = first == "--backwards",
             is_round = is_backwards || first == "--forwards";
  const int at = is_round ? 2 : 1;
  const long num_runs = argc > at ? std::strtol(argv[at], nullptr, 10) : 1000;
  const long num_rounds = argc > at + 1 ? std::strtol(argv[at + 1], nullptr, 10) : 6;
  if (num_runs < 1 || num_rounds < 1 || num_rounds > 1000) {
    std::fprintf(stderr, "usage: campaign_speed [RUNS [ROUNDS]]\n");
    return 2;
  }
  if (is_round) return holdfast::run_round(num_runs, is_backwards);
  return holdfast::run(num_runs, static_cast<int>(num_rounds));
}
