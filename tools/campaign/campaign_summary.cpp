#include "tools/campaign/campaign_summary.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <future>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "tools/campaign/campaign.h"

namespace holdfast {
namespace {

using Json = nlohmann::ordered_json;

// Histograms of more runs than this would fill the memory for one standard error.
constexpr std::size_t kRunsWithPacketsMax = 10'000;

// All estimators of a point, with the matrices that they point to.
struct PointRuns {
  std::vector<std::int64_t> runs;
  RunMatrix is_attacked, authentic_packets;
  std::vector<EstimatorRuns> estimators;
};

void load_packets(CampaignStore& store, std::int64_t point, RunRange range,
                  const std::vector<std::int64_t>& run_numbers, EstimatorRuns& runs) {
  const bool keeps_each = run_numbers.size() <= kRunsWithPacketsMax;
  store.for_each_packets(
      point, runs.estimator, range, [&](std::int64_t run, const ScoreHistogram& packets) {
        runs.packets.add(packets);
        if (!keeps_each) return;
        runs.packets_of_runs.resize(run_numbers.size());
        const auto row = std::ranges::lower_bound(run_numbers, run) - run_numbers.begin();
        runs.packets_of_runs[static_cast<std::size_t>(row)] = packets;
      });
}

void load(CampaignStore& store, std::int64_t point, RunRange range, PointRuns& loaded) {
  const StoredPoint& stored = store.points()[static_cast<std::size_t>(point)];
  loaded.runs = store.runs_of(point, range);
  if (loaded.runs.empty()) {
    throw UsageError(store.file() + " holds no run" +
                     (stored.settings.empty() ? "" : " of " + sweep_label(stored.settings)) +
                     " yet");
  }
  auto whole = store.read_curves(point, "", loaded.runs);
  loaded.is_attacked = std::move(whole["is_attacked"]);
  loaded.authentic_packets = std::move(whole["authentic_packets"]);
  for (const std::string& name : stored.estimators) {
    EstimatorRuns runs;
    runs.estimator = name;
    runs.curves = store.read_curves(point, name, loaded.runs);
    load_packets(store, point, range, loaded.runs, runs);
    runs.outcomes = store.read_counters(point, name, range);
    runs.is_attacked = &loaded.is_attacked;
    if (loaded.authentic_packets.num_runs() > 0) runs.authentic_packets = &loaded.authentic_packets;
    loaded.estimators.push_back(std::move(runs));
  }
}

double share_of_ones(const RunMatrix& matrix) {
  double sum = 0.0;
  for (std::size_t i = 0; i < matrix.num_runs(); ++i)
    for (const double value : matrix.run(i)) sum += value;
  return sum /
         static_cast<double>(std::max<std::size_t>(1, matrix.num_runs() * matrix.num_steps()));
}

const EstimatorMetrics* find(const PointSummary& point, const std::string& estimator) {
  for (const EstimatorSummary& it : point.estimators)
    if (it.metrics.estimator == estimator) return &it.metrics;
  return nullptr;
}

// What is said of one estimator depends on no other one, so threads change no bit of it.
std::vector<EstimatorMetrics> metrics_of(const std::vector<EstimatorRuns>& estimators,
                                         const MetricsOptions& options, int num_threads) {
  std::vector<EstimatorMetrics> metrics(estimators.size());
  std::atomic<std::size_t> next = 0;
  const auto work = [&] {
    for (std::size_t i = next++; i < estimators.size(); i = next++)
      metrics[i] = compute_metrics(estimators[i], options);
  };
  if (num_threads <= 0) num_threads = num_usable_processors();
  std::vector<std::future<void>> workers;
  for (int t = 1; t < std::min(num_threads, static_cast<int>(estimators.size())); ++t) {
    try {
      workers.push_back(std::async(std::launch::async, work));
    } catch (const std::system_error&) {
      break;  // no more threads may be made: those that are there do it
    }
  }
  work();
  for (std::future<void>& worker : workers) worker.get();
  return metrics;
}

Json number(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Json numbers(const std::vector<double>& values) {
  Json list = Json::array();
  for (const double value : values) list.push_back(number(value));
  return list;
}

Json to_json(const std::vector<PairedDifference>& differences) {
  Json list = Json::array();
  for (const PairedDifference& d : differences) {
    list.push_back({{"reference", d.reference},
                    {"name", d.name},
                    {"group", d.group},
                    {"unit", d.unit},
                    {"value", number(d.value)},
                    {"standard_error", number(d.standard_error)}});
  }
  return list;
}

Json to_json(const EstimatorSummary& estimator) {
  Json json = {{"estimator", estimator.metrics.estimator}, {"metrics", Json::array()}};
  for (const Metric& metric : estimator.metrics.metrics) {
    json["metrics"].push_back({{"name", metric.name},
                               {"group", metric.group},
                               {"unit", metric.unit},
                               {"value", number(metric.value)},
                               {"standard_error", number(metric.standard_error)},
                               {"count", metric.count}});
  }
  json["outcomes"] = estimator.metrics.outcomes;
  json["against_first"] = to_json(estimator.against_first);
  json["against_first_point"] = to_json(estimator.against_first_point);
  json["curves"] = Json::array();
  for (const MetricCurve& curve : estimator.metrics.curves) {
    Json entry = {{"name", curve.name},
                  {"group", curve.group},
                  {"unit", curve.unit},
                  {"value", numbers(curve.value)},
                  {"standard_error", numbers(curve.standard_error)}};
    if (!curve.low.empty()) {
      entry["low"] = numbers(curve.low);
      entry["high"] = numbers(curve.high);
    }
    json["curves"].push_back(std::move(entry));
  }
  json["rocs"] = Json::array();
  for (const RocCurve& roc : estimator.metrics.rocs) {
    json["rocs"].push_back({{"name", roc.name},
                            {"area", number(roc.area)},
                            {"false_alarm_rate", numbers(roc.false_alarm_rate)},
                            {"detection_rate", numbers(roc.detection_rate)}});
  }
  return json;
}

}  // namespace

CampaignSummary summarise(CampaignStore& store, RunRange range, int num_threads) {
  CampaignSummary summary;
  summary.scenario = store.meta("scenario");
  summary.version = store.meta("version");
  summary.commit = store.meta("commit");
  summary.kernel = store.meta("kernel");
  summary.identity = store.meta("identity");
  std::vector<std::int64_t> first_runs;
  std::size_t first_num_steps = 0;
  for (std::size_t p = 0; p < store.points().size(); ++p) {
    const StoredPoint& stored = store.points()[p];
    const Experiment experiment = experiment_from_text(stored.scenario, store.file());
    summary.seed = experiment.seed;
    MetricsOptions options;
    options.seed = experiment.seed;
    options.detection_threshold = experiment.detection_threshold;
    options.groups = experiment.state_groups;
    options.windows = experiment.windows;
    options.mode_hold_steps = experiment.mode_hold_steps;
    PointRuns loaded;
    const auto point = static_cast<std::int64_t>(p);
    load(store, point, range, loaded);
    if (p == 0) {
      first_runs = loaded.runs;
      first_num_steps = loaded.is_attacked.num_steps();
    }
    PointSummary row;
    row.settings = stored.settings;
    row.num_runs = static_cast<std::int64_t>(loaded.runs.size());
    row.num_steps = experiment.num_steps;
    row.attacked_share = share_of_ones(loaded.is_attacked);
    row.counters = store.read_counters(point, "", range);
    for (EstimatorMetrics& metrics : metrics_of(loaded.estimators, options, num_threads)) {
      EstimatorSummary estimator;
      estimator.metrics = std::move(metrics);
      if (!row.estimators.empty()) {
        estimator.against_first =
            paired_differences(estimator.metrics, row.estimators.front().metrics, options);
      }
      const std::string& name = estimator.metrics.estimator;
      const EstimatorMetrics* before = p == 0 ? nullptr : find(summary.points.front(), name);
      // Common random numbers want the same runs and as many steps.
      if (before != nullptr && first_runs == loaded.runs &&
          first_num_steps == loaded.is_attacked.num_steps())
        estimator.against_first_point = paired_differences(estimator.metrics, *before, options);
      estimator.step_times = store.read_step_times(point, name, range);
      row.estimators.push_back(std::move(estimator));
    }
    summary.points.push_back(std::move(row));
  }
  return summary;
}

std::string to_json(const CampaignSummary& summary) {
  Json json = {{"scenario", summary.scenario}, {"seed", summary.seed},
               {"version", summary.version},   {"commit", summary.commit},
               {"kernel", summary.kernel},     {"identity", summary.identity}};
  json["points"] = Json::array();
  for (const PointSummary& point : summary.points) {
    Json entry = {{"settings", point.settings}, {"runs", point.num_runs},
                  {"steps", point.num_steps},   {"attacked_share", number(point.attacked_share)},
                  {"counters", point.counters}, {"estimators", Json::array()}};
    for (const EstimatorSummary& estimator : point.estimators)
      entry["estimators"].push_back(to_json(estimator));
    json["points"].push_back(std::move(entry));
  }
  return json.dump(1) + "\n";
}

}  // namespace holdfast
