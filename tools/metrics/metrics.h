#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "tools/metrics/run_matrix.h"
#include "tools/metrics/run_scores.h"
#include "tools/metrics/windows.h"

namespace holdfast {

struct MetricsOptions {
  std::int64_t seed = 1;             // of the bootstrap's own stream
  int num_resamples = 400;           // of the bootstrap
  double detection_threshold = 0.5;  // an attack is called at this attack probability or above
  double band_probability = 0.95;    // of the chi-square bands
  std::vector<StateGroup> groups;
  std::vector<MetricsWindow> windows;
  std::int64_t mode_hold_steps = 1;  // a mode counts as found once it is right so often in a row
};

/// One number with its standard error; NaN where it has none (a single run, no closed form).
struct Metric {
  std::string name;  // e.g. "rmse_step_mean"; each is defined in docs/metrics.md
  // Of states, of attack channels ("2": the second) or of components; empty for a metric of the
  // whole estimator. "angle@on" is that of group angle in window on.
  std::string group;
  std::string unit;  // empty: a share or a pure number
  double value = 0.0;
  double standard_error = 0.0;
  std::int64_t count = 0;  // runs, steps or packets that went in, as docs/metrics.md says
};

/// One number at each step, with a band around it where there is one.
struct MetricCurve {
  std::string name, group, unit;
  std::vector<double> value, standard_error;  // [num_steps]
  std::vector<double> low, high;  // [num_steps] band expected of an honest filter, or empty
};

/// Receiver operating characteristic: points by rising false-alarm rate, from (0, 0) to (1, 1).
struct RocCurve {
  std::string name;  // "steps" or "packets"
  std::vector<double> false_alarm_rate, detection_rate;
  double area = 0.0;  // ties count one half
};

/// All runs of one estimator.
struct EstimatorRuns {
  std::string estimator;
  std::map<std::string, RunMatrix> curves;  // by the names of RunScores
  ScoreHistogram packets;                   // summed over runs
  std::vector<ScoreHistogram>
      packets_of_runs;  // only for auc_packets' standard error; may be empty
  std::map<std::string, std::int64_t> outcomes;
  const RunMatrix* is_attacked = nullptr;        // [run][step] 1 or 0; null when not known
  const RunMatrix* authentic_packets = nullptr;  // [run][step] how many; null when not known
};

/// rmse_step_mean of each resample of the bootstrap, for paired differences.
struct ResampledRmse {
  std::size_t num_runs = 0, num_steps = 0;
  std::vector<double> values;  // [resample]; empty when fewer than two runs have values
};

struct EstimatorMetrics {
  std::string estimator;
  std::vector<Metric> metrics;
  std::vector<MetricCurve> curves;
  std::vector<RocCurve> rocs;
  std::map<std::string, std::int64_t> outcomes;
  std::map<std::string, ResampledRmse> resampled_rmse;  // by group
};

/// Every metric that the runs' curves allow; one without any value is left out. The result depends
/// on nothing but the arguments: sums run in the order of runs and steps, the bootstrap has its own
/// stream. Throws std::invalid_argument when the curves differ in runs or steps.
EstimatorMetrics compute_metrics(const EstimatorRuns& runs, const MetricsOptions& options);

/// Metric of an estimator; null when there is none of that name and group.
const Metric* find_metric(const EstimatorMetrics& estimator, const std::string& name,
                          const std::string& group = "");
const MetricCurve* find_curve(const EstimatorMetrics& estimator, const std::string& name,
                              const std::string& group = "");

/// Difference of a metric between two estimators over the same runs (common random numbers).
struct PairedDifference {
  std::string estimator, reference;  // value: estimator's minus reference's
  std::string name, group, unit;
  double value = 0.0, standard_error = 0.0;
};

/// rmse_step_mean of each state group that both have, both estimators resampled with the same runs:
/// by compute_metrics() with one seed. Throws std::invalid_argument when they differ in runs or
/// steps.
std::vector<PairedDifference> paired_differences(const EstimatorMetrics& ours,
                                                 const EstimatorMetrics& reference,
                                                 const MetricsOptions& options);

/// One attack in one run, as a detector with this threshold sees it. Steps count from 1: element i
/// of a curve is step i + 1.
struct DetectionEvent {
  std::int64_t first_step = 0, last_step = 0;  // of the attack
  std::int64_t detected_step = -1;             // -1: missed
};

/// Maximal intervals of attacked steps with their first alarm, in order. NaN probability: no alarm;
/// NaN in is_attacked: not known, so it ends an interval. The spans have one length.
std::vector<DetectionEvent> detection_events(std::span<const double> attack_probability,
                                             std::span<const double> is_attacked, double threshold);

}  // namespace holdfast
