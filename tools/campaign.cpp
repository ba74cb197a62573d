#include "tools/campaign.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <holdfast/estimate_t.hpp>
#include <holdfast/measurement_set_t.hpp>
#include <holdfast/run_meta_t.hpp>
#include <holdfast/truth_t.hpp>
#include <iomanip>
#include <mutex>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "common/clock.h"
#include "common/log_file.h"
#include "common/measurement_messages.h"
#include "common/run_meta.h"
#include "common/status.h"
#include "estimators/estimate_messages.h"
#include "plant/truth_messages.h"
#include "tools/simulation.h"

namespace holdfast {
namespace {

constexpr int kBootstrapResamples = 400;

// Squared errors of all runs, [run][estimator and group][step].
struct SquaredErrors {
  std::size_t num_steps = 0, num_columns = 0;
  std::vector<double> values;

  double* at(std::size_t run, std::size_t column) {
    return &values[(run * num_columns + column) * num_steps];
  }
  const double* at(std::size_t run, std::size_t column) const {
    return &values[(run * num_columns + column) * num_steps];
  }
};

double squared_error(const Eigen::VectorXd& estimate, const Eigen::VectorXd& truth,
                     const StateGroup& group) {
  double sum = 0.0;
  for (const int state : group.states) {
    const double error = estimate[state] - truth[state];
    sum += error * error;
  }
  return sum;
}

std::int64_t simulate(const Experiment& experiment, std::uint32_t run, std::size_t row,
                      SquaredErrors& errors) {
  Simulation simulation(experiment, run);
  const std::size_t num_groups = experiment.state_groups.size();
  std::int64_t not_ok = 0;
  for (std::size_t step = 0; simulation.advance(); ++step) {
    for (std::size_t i = 0; i < simulation.estimates().size(); ++i) {
      const Estimate& estimate = *simulation.estimates()[i];
      const bool is_ok =
          estimate.outcome == StepOutcome::kOk || estimate.outcome == StepOutcome::kNoPackets;
      not_ok += is_ok ? 0 : 1;
      for (std::size_t g = 0; g < num_groups; ++g) {
        errors.at(row, i * num_groups + g)[step] =
            squared_error(estimate.mean, simulation.truth().state, experiment.state_groups[g]);
      }
    }
  }
  return not_ok;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

// Bootstrap over runs: a resample draws as many runs, with replacement, as there are.
double bootstrap_error(const SquaredErrors& errors, std::size_t column, std::size_t num_runs,
                       std::int64_t seed) {
  const RandomStream draws(static_cast<std::uint64_t>(seed), 0, "campaign/bootstrap");
  double sum = 0.0, sum_squared = 0.0;
  std::vector<double> mean_squared(errors.num_steps);
  for (int resample = 0; resample < kBootstrapResamples; ++resample) {
    std::fill(mean_squared.begin(), mean_squared.end(), 0.0);
    for (std::size_t i = 0; i < num_runs; ++i) {
      const double position =
          draws.uniform(static_cast<std::uint32_t>(resample), i) * static_cast<double>(num_runs);
      const double* run =
          errors.at(std::min(static_cast<std::size_t>(position), num_runs - 1), column);
      for (std::size_t k = 0; k < errors.num_steps; ++k) mean_squared[k] += run[k];
    }
    double mean = 0.0;
    for (const double value : mean_squared)
      mean += std::sqrt(value / static_cast<double>(num_runs));
    mean /= static_cast<double>(errors.num_steps);
    sum += mean;
    sum_squared += mean * mean;
  }
  const double mean = sum / kBootstrapResamples;
  return std::sqrt(std::max(0.0, sum_squared / kBootstrapResamples - mean * mean));
}

CampaignError summarise(const SquaredErrors& errors, std::size_t column, std::size_t num_runs,
                        std::int64_t seed) {
  CampaignError summary;
  std::vector<double> per_run(num_runs);
  summary.rmse_over_runs.assign(errors.num_steps, 0.0);
  for (std::size_t run = 0; run < num_runs; ++run) {
    const double* values = errors.at(run, column);
    double sum = 0.0;
    for (std::size_t k = 0; k < errors.num_steps; ++k) {
      summary.rmse_over_runs[k] += values[k];
      sum += values[k];
    }
    per_run[run] = std::sqrt(sum / static_cast<double>(errors.num_steps));
  }
  for (double& value : summary.rmse_over_runs)
    value = std::sqrt(value / static_cast<double>(num_runs));
  summary.rmse_step_mean = mean_of_first(summary.rmse_over_runs, errors.num_steps);
  summary.standard_error = bootstrap_error(errors, column, num_runs, seed);
  summary.rmse_per_run_median = median(per_run);
  return summary;
}

// Hands runs to threads one by one; the first exception stops all and is thrown on.
void for_each_run(const CampaignOptions& options, int num_threads,
                  const std::function<void(std::int64_t)>& body) {
  std::atomic<std::int64_t> next{0}, done{0};
  std::mutex mutex;
  std::exception_ptr failure;
  const auto work = [&] {
    for (std::int64_t i = next++; i < options.num_runs; i = next++) {
      try {
        body(i);
      } catch (...) {
        const std::scoped_lock lock(mutex);
        if (!failure) failure = std::current_exception();
        next = options.num_runs;
      }
      const std::int64_t count = ++done;
      const std::scoped_lock lock(mutex);
      if (options.on_progress) options.on_progress(count, options.num_runs);
    }
  };
  std::vector<std::thread> threads;
  for (int t = 1; t < num_threads; ++t) threads.emplace_back(work);
  work();
  for (std::thread& thread : threads) thread.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace

double mean_of_first(const std::vector<double>& curve, std::size_t num_steps) {
  const std::size_t count = std::min(num_steps, curve.size());
  double sum = 0.0;
  for (std::size_t k = 0; k < count; ++k) sum += curve[k];
  return count == 0 ? 0.0 : sum / static_cast<double>(count);
}

CampaignResult run_campaign(const Experiment& experiment, const CampaignOptions& options) {
  CampaignResult result;
  result.scenario = experiment.name;
  result.kernel = experiment.kernel_text();
  result.seed = experiment.seed;
  result.num_runs = options.num_runs;
  result.num_steps = experiment.num_steps;
  result.num_threads = options.num_threads > 0
                           ? options.num_threads
                           : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  std::vector<std::pair<std::string, StateGroup>> columns;
  for (const EstimatorEntry& entry : experiment.estimators) {
    if (entry.is_outside()) continue;
    for (const StateGroup& group : experiment.state_groups) columns.emplace_back(entry.name, group);
  }
  if (columns.empty())
    throw UsageError("scenario " + experiment.name + " has no estimator that a campaign could run");
  const auto num_runs = static_cast<std::size_t>(options.num_runs);
  constexpr double kBytesMax = 16e9;
  const double bytes = 8.0 * static_cast<double>(options.num_runs) *
                       static_cast<double>(experiment.num_steps) *
                       static_cast<double>(columns.size());
  if (bytes > kBytesMax) {
    throw UsageError("this campaign would keep " + std::to_string(static_cast<int>(bytes * 1e-9)) +
                     " GB of errors; split it by --first-run and --runs");
  }
  SquaredErrors errors{static_cast<std::size_t>(experiment.num_steps), columns.size(), {}};
  errors.values.resize(errors.num_steps * errors.num_columns * num_runs);
  std::atomic<std::int64_t> not_ok{0};
  const std::int64_t started_ns = monotonic_time_ns();
  for_each_run(options, result.num_threads, [&](std::int64_t i) {
    not_ok += simulate(experiment, static_cast<std::uint32_t>(options.first_run + i),
                       static_cast<std::size_t>(i), errors);
  });
  result.seconds = static_cast<double>(monotonic_time_ns() - started_ns) * 1e-9;
  result.steps_not_ok = not_ok;
  for (std::size_t column = 0; column < columns.size(); ++column) {
    CampaignError error = summarise(errors, column, num_runs, experiment.seed);
    error.estimator = columns[column].first;
    error.group = columns[column].second.name;
    error.unit = columns[column].second.unit;
    result.errors.push_back(std::move(error));
  }
  return result;
}

std::string to_text(const CampaignResult& result) {
  std::ostringstream text;
  text << "campaign " << result.scenario << ": " << result.num_runs << " runs of "
       << result.num_steps << " steps, seed " << result.seed << ", " << std::fixed
       << std::setprecision(1) << result.seconds << " s on " << result.num_threads
       << " threads\n\n";
  text << std::left << std::setw(18) << "estimator" << std::setw(12) << "group" << std::right
       << std::setw(12) << "RMSE" << std::setw(12) << "s.e." << std::setw(16) << "median per run"
       << "  unit\n";
  for (const CampaignError& error : result.errors) {
    text << std::left << std::setw(18) << error.estimator << std::setw(12) << error.group
         << std::right << std::setprecision(4) << std::setw(12) << error.rmse_step_mean
         << std::setw(12) << error.standard_error << std::setw(16) << error.rmse_per_run_median
         << "  " << error.unit << "\n";
  }
  text << "\nRMSE: root mean square over runs at each step, then the mean over steps; s.e. by "
          "bootstrap over runs\n";
  if (result.steps_not_ok > 0)
    text << result.steps_not_ok << " steps had an outcome other than ok\n";
  return text.str();
}

std::string to_json(const CampaignResult& result) {
  nlohmann::ordered_json json;
  json["scenario"] = result.scenario;
  json["seed"] = result.seed;
  json["runs"] = result.num_runs;
  json["steps"] = result.num_steps;
  json["version"] = version_text();
  json["commit"] = commit_text();
  json["kernel"] = result.kernel;
  json["steps_not_ok"] = result.steps_not_ok;
  for (const CampaignError& error : result.errors) {
    json["errors"].push_back({{"estimator", error.estimator},
                              {"group", error.group},
                              {"unit", error.unit},
                              {"rmse_step_mean", error.rmse_step_mean},
                              {"standard_error", error.standard_error},
                              {"rmse_per_run_median", error.rmse_per_run_median},
                              {"rmse_over_runs", error.rmse_over_runs}});
  }
  return json.dump(1) + "\n";
}

void write_run_log(const Experiment& experiment, std::uint32_t run, const std::string& file) {
  LogWriter writer(file + ".part");
  run_meta_t meta = to_message(RunMeta{experiment.name, experiment.resolved, experiment.seed, run,
                                       experiment.kernel_text()});
  writer.write_message("RUN_META", 0, meta);
  Simulation simulation(experiment, run);
  truth_t truth;
  measurement_set_t measurement;
  estimate_t message;
  while (simulation.advance()) {
    const std::int64_t utime = simulation.measurements().utime;
    to_message(simulation.truth(), utime, truth);
    writer.write_message("PLANT_TRUTH", utime, truth);
    to_message(simulation.measurements(), measurement);
    writer.write_message("MEASUREMENT", utime, measurement);
    for (std::size_t i = 0; i < simulation.estimates().size(); ++i) {
      to_message(*simulation.estimates()[i], message);
      writer.write_message(channel_name("EST_", simulation.entries()[i]->name), utime, message);
    }
  }
  writer.finish_as(file);
}

}  // namespace holdfast
