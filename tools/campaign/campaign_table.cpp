#include <algorithm>
#include <cmath>

#include "tools/campaign/campaign_figures.h"
#include "tools/campaign/campaign_summary.h"
#include "tools/log_csv.h"
#include "tools/printable_text.h"
#include "tools/review_tables.h"
#include "tools/text_table.h"

namespace holdfast {
namespace {

std::string metric_text(const EstimatorMetrics& estimator, const std::string& name,
                        const std::string& group) {
  const Metric* metric = find_metric(estimator, name, group);
  return metric == nullptr ? "-" : number_with_error(metric->value, metric->standard_error);
}

std::string difference_text(const std::vector<PairedDifference>& differences,
                            const std::string& group) {
  for (const PairedDifference& d : differences) {
    if (d.group == group)
      return (d.value > 0.0 ? "+" : "") + number_with_error(d.value, d.standard_error);
  }
  return "-";
}

std::string error_table(const PointSummary& point) {
  TextTable table(2);
  const std::string first = point.estimators.front().metrics.estimator;
  const bool is_swept =
      std::any_of(point.estimators.begin(), point.estimators.end(),
                  [](const EstimatorSummary& e) { return !e.against_first_point.empty(); });
  std::vector<std::string> header = {
      "estimator", "group",           "rmse_step_mean (s.e.)", "rmse_over_time_median",
      "lost",      "against " + first};
  if (is_swept) header.emplace_back("against first point");
  header.emplace_back("unit");
  table.add(header);
  for (const EstimatorSummary& estimator : point.estimators) {
    for (const Metric& metric : estimator.metrics.metrics) {
      if (metric.name != "rmse_step_mean") continue;
      std::vector<std::string> row = {
          estimator.metrics.estimator,
          metric.group,
          number_with_error(metric.value, metric.standard_error),
          metric_text(estimator.metrics, "rmse_over_time_median", metric.group),
          metric_text(estimator.metrics, "lost_share", metric.group),
          difference_text(estimator.against_first, metric.group)};
      if (is_swept) row.push_back(difference_text(estimator.against_first_point, metric.group));
      row.push_back(printable(metric.unit, 20));
      table.add(row);
    }
  }
  return table.text();
}

// Everything that is no error of a state group: one row a metric, one column an estimator.
std::string other_table(const PointSummary& point) {
  std::vector<std::string> names;
  for (const EstimatorSummary& estimator : point.estimators) {
    for (const Metric& metric : estimator.metrics.metrics) {
      if (metric.group.empty() && std::ranges::find(names, metric.name) == names.end())
        names.push_back(metric.name);
    }
  }
  TextTable table;
  std::vector<std::string> header = {"metric"};
  for (const EstimatorSummary& estimator : point.estimators)
    header.push_back(estimator.metrics.estimator);
  table.add(header);
  for (const std::string& name : names) {
    std::vector<std::string> row = {name};
    for (const EstimatorSummary& estimator : point.estimators)
      row.push_back(metric_text(estimator.metrics, name, ""));
    table.add(row);
  }
  std::vector<std::string> times = {"step time p50 / p99, us"};
  for (const EstimatorSummary& estimator : point.estimators) {
    times.push_back(number_text(1e-3 * estimator.step_times.percentile_ns(0.5), 3) + " / " +
                    number_text(1e-3 * estimator.step_times.percentile_ns(0.99), 3));
  }
  table.add(times);
  return table.text();
}

std::string outcome_lines(const PointSummary& point) {
  std::string text;
  for (const EstimatorSummary& estimator : point.estimators) {
    for (const auto& [name, count] : estimator.metrics.outcomes) {
      text += estimator.metrics.estimator + ": " + std::to_string(count) + " steps " + name + "\n";
    }
  }
  return text;
}

std::string exact(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", value);
  return std::isfinite(value) ? text : "";
}

}  // namespace

std::string to_text(const CampaignSummary& summary) {
  std::string text = "campaign " + summary.scenario + ", seed " + std::to_string(summary.seed) +
                     ", kernel " + summary.kernel + "\n";
  if (summary.points.size() > kPointsShownMax) {
    return text + "\n" + text_of(comparison_table(summary)) +
           "\nEvery metric of every point: --csv. What they mean: docs/metrics.md.\n";
  }
  for (const PointSummary& point : summary.points) {
    text += "\n" + (point.settings.empty() ? "" : printable(sweep_label(point.settings)) + ": ") +
            std::to_string(point.num_runs) + " runs of " + std::to_string(point.num_steps) +
            " steps, " + number_text(100.0 * point.attacked_share, 3) + " % of them attacked\n\n" +
            error_table(point) + "\n" + other_table(point) + outcome_lines(point);
  }
  return text +
         "\nrmse_step_mean: root mean square over runs at each step, then the mean over steps. "
         "What the others mean stands in docs/metrics.md.\n";
}

std::string to_csv(const CampaignSummary& summary) {
  std::string text = "point,settings,runs,estimator,metric,group,unit,value,standard_error,count\n";
  for (std::size_t p = 0; p < summary.points.size(); ++p) {
    const PointSummary& point = summary.points[p];
    for (const EstimatorSummary& estimator : point.estimators) {
      for (const Metric& metric : estimator.metrics.metrics) {
        text += std::to_string(p) + "," + csv_text(sweep_label(point.settings)) + "," +
                std::to_string(point.num_runs) + "," + csv_text(estimator.metrics.estimator) + "," +
                metric.name + "," + metric.group + "," + csv_text(metric.unit) + "," +
                exact(metric.value) + "," + exact(metric.standard_error) + "," +
                std::to_string(metric.count) + "\n";
      }
    }
  }
  return text;
}

std::string curves_to_csv(const CampaignSummary& summary) {
  std::string text =
      "point,settings,estimator,curve,group,unit,step,value,standard_error,low,high\n";
  const auto cell = [](const std::vector<double>& values, std::size_t k) {
    return k < values.size() ? exact(values[k]) : std::string();
  };
  for (std::size_t p = 0; p < summary.points.size(); ++p) {
    const PointSummary& point = summary.points[p];
    const std::string head = std::to_string(p) + "," + csv_text(sweep_label(point.settings)) + ",";
    for (const EstimatorSummary& estimator : point.estimators) {
      for (const MetricCurve& curve : estimator.metrics.curves) {
        for (std::size_t k = 0; k < curve.value.size(); ++k) {
          text += head + csv_text(estimator.metrics.estimator) + "," + curve.name + "," +
                  curve.group + "," + csv_text(curve.unit) + "," + std::to_string(k + 1) + "," +
                  cell(curve.value, k) + "," + cell(curve.standard_error, k) + "," +
                  cell(curve.low, k) + "," + cell(curve.high, k) + "\n";
        }
      }
    }
  }
  return text;
}

}  // namespace holdfast
