// campaign_speed [RUNS [ROUNDS]]: how much of the bare filter's speed a whole campaign keeps.
// Prints both, side by side, in one run; the campaign simulates plant, bus and attacker, scores and
// stores as well.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <thread>
#include <vector>

#include "common/clock.h"
#include "tools/campaign/campaign.h"
#include "tools/campaign/campaign_summary.h"
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

// Mean over the rounds and its standard error.
struct Mean {
  double value, error;
};

template <class Value>
Mean mean_over(const std::vector<Round>& rounds, const Value& value) {
  const auto count = static_cast<double>(rounds.size());
  double sum = 0.0, squares = 0.0;
  for (const Round& round : rounds) sum += value(round);
  const double mean = sum / count;
  for (const Round& round : rounds) squares += (value(round) - mean) * (value(round) - mean);
  return {mean, count < 2.0 ? 0.0 : std::sqrt(squares / (count - 1.0) / count)};
}

template <class Value>
void print_row(const char* text, const std::vector<Round>& rounds, double num_cores,
               const Value& rate, const char* remark) {
  const Mean speed = mean_over(rounds, rate);
  const Mean share =
      mean_over(rounds, [&](const Round& round) { return rate(round) / (round.one * num_cores); });
  std::printf("%-44s %12.0f %8.3f (%.3f)%s\n", text, speed.value, share.value, share.error, remark);
}

int run(std::int64_t num_runs, int num_rounds) {
  const std::string scenario = std::string(HOLDFAST_SOURCE_DIR) + "/scenarios/binary_tracking.yaml";
  const std::vector<std::string> overrides = {
      "estimators=[{name: secure, method: secure_particle_filter, particles: 500, "
      "packet_posteriors: false}]"};
  const Experiment experiment = load_experiment(scenario, overrides);
  const int num_cores = default_threads(ProcessGroup());
  const auto sets = record_sets(experiment, 20);
  const int num_passes = static_cast<int>(std::max<std::int64_t>(1, num_runs / 40));
  std::printf("Sec-PF, M = 500, %ld steps, %ld runs, kernel %s, %d cores, %d rounds\n",
              static_cast<long>(experiment.num_steps), static_cast<long>(num_runs),
              experiment.kernel_text().c_str(), num_cores, num_rounds);
  // What a loop reaches changes with the moment, so shares are taken within a round, every second
  // one backwards, and averaged.
  std::vector<Round> rounds(static_cast<std::size_t>(num_rounds));
  for (std::size_t i = 0; i < rounds.size(); ++i) {
    const std::array<std::function<void()>, 3> loops = {
        [&] { rounds[i].one = bare_steps_per_s(experiment, sets, num_passes); },
        [&] { rounds[i].all = bare_on_all(experiment, sets, num_passes, num_cores); },
        [&] {
          rounds[i].campaign = campaign_steps_per_s(scenario, overrides, num_runs, num_cores);
        }};
    for (std::size_t j = 0; j < loops.size(); ++j) loops[i % 2 == 0 ? j : loops.size() - 1 - j]();
  }
  std::printf("%-44s %12s %8s (%s)\n", "", "steps/s", "share", "s.e.");
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

}  // namespace
}  // namespace holdfast

int main(int argc, char** argv) {
  const long num_runs = argc > 1 ? std::strtol(argv[1], nullptr, 10) : 1000;
  const long num_rounds = argc > 2 ? std::strtol(argv[2], nullptr, 10) : 6;
  if (num_runs < 1 || num_rounds < 1 || num_rounds > 1000) {
    std::fprintf(stderr, "usage: campaign_speed [RUNS [ROUNDS]]\n");
    return 2;
  }
  return holdfast::run(num_runs, static_cast<int>(num_rounds));
}
