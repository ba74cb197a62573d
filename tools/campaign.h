#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tools/experiment.h"

namespace holdfast {

struct CampaignOptions {
  std::int64_t num_runs = 100;
  std::int64_t first_run = 0;
  int num_threads = 0;  // 0: one per processor
  /// Called now and then with (runs done, runs in all), by one thread at a time. May be empty.
  std::function<void(std::int64_t, std::int64_t)> on_progress;
};

/// Errors of one estimator in one state group over a campaign.
struct CampaignError {
  std::string estimator, group, unit;
  std::vector<double> rmse_over_runs;  // [steps], root mean square over runs at each step
  double rmse_step_mean = 0.0;         // mean over steps of the above: the papers' tables
  double standard_error = 0.0;         // of that mean; bootstrap over runs, 400 resamples
  double rmse_per_run_median = 0.0;    // median over runs of the root mean square over steps
};

struct CampaignResult {
  std::string scenario, kernel;
  std::int64_t seed = 0, num_runs = 0, num_steps = 0;
  std::vector<CampaignError> errors;
  std::int64_t steps_not_ok = 0;  // outcomes other than ok and no_packets
  double seconds = 0.0;
  int num_threads = 0;
};

/// Runs the experiment num_runs times in process, run indices from first_run.
///
/// The result does not depend on the number of threads: errors are kept per run and reduced in the
/// order of the runs. Throws what a run throws.
CampaignResult run_campaign(const Experiment& experiment, const CampaignOptions& options);

/// Mean over the first num_steps steps of a curve; for tables that average over a part of a run.
double mean_of_first(const std::vector<double>& curve, std::size_t num_steps);

/// Aligned text table.
std::string to_text(const CampaignResult& result);
/// JSON with the curves.
std::string to_json(const CampaignResult& result);

/// Writes one run as a log: RUN_META, PLANT_TRUTH, MEASUREMENT and EST_<NAME>, as live processes
/// publish them.
void write_run_log(const Experiment& experiment, std::uint32_t run, const std::string& file);

}  // namespace holdfast
