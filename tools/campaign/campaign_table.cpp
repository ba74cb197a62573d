#include "tools/campaign/campaign_table.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tools/log_csv.h"
#include "tools/printable_text.h"
#include "tools/review_tables.h"
#include "tools/text_table.h"

namespace holdfast {
namespace {

std::string difference_text(const std::vector<PairedDifference>& differences,
                            const std::string& group) {
  const auto found = std::ranges::find(differences, group, &PairedDifference::group);
  if (found == differences.end()) return "-";
  return (found->value > 0.0 ? "+" : "") + number_with_error(found->value, found->standard_error);
}

std::string metric_text(const EstimatorMetrics& estimator, const std::string& name,
                        const std::string& group) {
  const Metric* metric = find_metric(estimator, name, group);
  return metric == nullptr ? "-" : number_with_error(metric->value, metric->standard_error);
}

ReportTable step_time_table(const PointSummary& point) {
  ReportTable table{"Step times", {"estimator", "p50 us", "p99 us", "max us"}, {}, ""};
  for (const EstimatorSummary& estimator : point.estimators) {
    const TimeHistogram& times = estimator.step_times;
    table.rows.push_back({estimator.metrics.estimator,
                          number_text(1e-3 * times.percentile_ns(0.5), 3),
                          number_text(1e-3 * times.percentile_ns(0.99), 3),
                          number_text(1e-3 * times.percentile_ns(1.0), 3)});
  }
  return table;
}

std::string outcome_lines(const PointSummary& point) {
  std::string text;
  for (const EstimatorSummary& estimator : point.estimators) {
    for (const auto& [name, count] : estimator.metrics.outcomes)
      text += estimator.metrics.estimator + ": " + std::to_string(count) + " steps " + name + "\n";
  }
  return text;
}

std::string exact(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", value);
  return std::isfinite(value) ? text : "";
}

}  // namespace

std::string point_label(const PointSummary& point) {
  return printable(sweep_label(point.settings), 120);
}

std::string label_with_unit(const std::string& name, const std::string& unit) {
  return unit.empty() ? name : name + " [" + printable(unit, 20) + "]";
}

ReportTable comparison_table(std::span<const PointSummary> points) {
  ReportTable table;
  table.title = "RMSE of estimators x points";
  table.header = {"point",
                  "estimator",
                  "group",
                  "rmse_step_mean",
                  "rmse_over_time_median",
                  "lost",
                  "against the first estimator",
                  "against the first point"};
  for (const PointSummary& point : points) {
    for (const EstimatorSummary& estimator : point.estimators) {
      for (const Metric& metric : estimator.metrics.metrics) {
        if (metric.name != "rmse_step_mean") continue;
        table.rows.push_back({point_label(point), estimator.metrics.estimator,
                              label_with_unit(metric.group, metric.unit),
                              number_with_error(metric.value, metric.standard_error),
                              metric_text(estimator.metrics, "rmse_over_time_median", metric.group),
                              metric_text(estimator.metrics, "lost_share", metric.group),
                              difference_text(estimator.against_first, metric.group),
                              difference_text(estimator.against_first_point, metric.group)});
      }
    }
  }
  // Columns that say nothing: the point of a campaign without a sweep, a difference to nobody.
  for (const std::size_t column : {std::size_t{7}, std::size_t{6}, std::size_t{0}}) {
    const bool is_empty = std::ranges::all_of(table.rows, [column](const auto& row) {
      return row[column].empty() || row[column] == "-";
    });
    if (!is_empty) continue;
    const auto at = static_cast<std::ptrdiff_t>(column);
    table.header.erase(table.header.begin() + at);
    for (auto& row : table.rows) row.erase(row.begin() + at);
  }
  table.note =
      "Value ± standard error. Differences are paired: the same runs, with the same "
      "random numbers.";
  return table;
}

ReportTable metric_table(const PointSummary& point) {
  std::vector<const EstimatorMetrics*> estimators;
  for (const EstimatorSummary& estimator : point.estimators)
    estimators.push_back(&estimator.metrics);
  ReportTable table = metric_table(estimators, true);
  if (!point.settings.empty()) table.title = point_label(point);
  table.note = std::to_string(point.num_runs) + (point.num_runs == 1 ? " run" : " runs") + " of " +
               std::to_string(point.num_steps) + (point.num_steps == 1 ? " step, " : " steps, ") +
               number_text(100.0 * point.attacked_share, 3) + " % of the steps attacked.";
  return table;
}

std::string to_text(const CampaignSummary& summary) {
  std::string text = "campaign " + summary.scenario + ", seed " + std::to_string(summary.seed) +
                     ", kernel " + summary.kernel + "\n\n" +
                     text_of(comparison_table(summary.points));
  if (summary.points.size() > kPointsShownMax) {
    return text + "\nEvery metric of every point: --csv. What they mean: docs/metrics.md.\n";
  }
  for (const PointSummary& point : summary.points) {
    const ReportTable metrics = metric_table(point);
    text += "\n" + (point.settings.empty() ? "" : point_label(point) + ": ") + metrics.note +
            "\n\n" + text_of(metrics) + "\n" + text_of(step_time_table(point)) +
            outcome_lines(point);
  }
  return text +
         "\nValue ± standard error; differences are paired. What each number means: "
         "docs/metrics.md.\n";
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
