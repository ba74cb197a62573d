#include "tools/campaign/campaign_figures.h"

#include <algorithm>
#include <cstdlib>
#include <numeric>
#include <set>
#include <tuple>

#include "tools/campaign/campaign_table.h"
#include "tools/review_figure_parts.h"
#include "tools/text_table.h"

namespace holdfast {
namespace {

bool is_number(const std::string& text) {
  char* end = nullptr;
  std::strtod(text.c_str(), &end);
  return !text.empty() && *end == '\0';
}

// NEES and NIS of a filter that lost its track reach any power of ten.
bool is_chi_square(const std::string& metric) {
  return metric.starts_with("nees_mean") || metric.starts_with("nis_mean");
}

// A symmetric band has no place on a logarithmic axis.
void show_on_log(Figure& figure) {
  figure.has_log_y = true;
  for (FigureSeries& series : figure.series) series.low.clear(), series.high.clear();
  figure.note = "Without bands: the axis is logarithmic.";
}

void add_with_band(FigureSeries& series, double x, double value, double standard_error) {
  series.x.push_back(x);
  series.y.push_back(value);
  series.low.push_back(value - kFigureBandErrors * standard_error);
  series.high.push_back(value + kFigureBandErrors * standard_error);
}

struct CurveKind {
  const char* name;
  const char* title;
  bool has_log_y;
};
constexpr CurveKind kCurves[] = {{"rmse_over_runs", "RMSE over runs", false},
                                 {"nees", "Mean NEES", true},
                                 {"nis", "Mean NIS", true},
                                 {"attack_probability", "Mean attack probability", false},
                                 {"mode_accuracy", "Share of runs with the right mode", false}};

// Groups, with units, that any estimator has a curve of this name for.
std::vector<std::pair<std::string, std::string>> groups_of(const PointSummary& point,
                                                           const std::string& curve) {
  std::vector<std::pair<std::string, std::string>> groups;
  for (const EstimatorSummary& estimator : point.estimators) {
    for (const MetricCurve& one : estimator.metrics.curves) {
      const std::pair group(one.group, one.unit);
      if (one.name == curve && std::ranges::find(groups, group) == groups.end())
        groups.push_back(group);
    }
  }
  return groups;
}

// Where honest filters lie: the first estimator's band, as two levels' worth of dashed lines.
void add_expected_band(const PointSummary& point, const std::string& curve, Figure& figure) {
  for (const EstimatorSummary& estimator : point.estimators) {
    const MetricCurve* found = find_curve(estimator.metrics, curve, "");
    if (found == nullptr || found->low.empty()) continue;
    for (const auto& [name, values] :
         {std::pair("95 % band, low", &found->low), std::pair("95 % band, high", &found->high)}) {
      FigureSeries series;
      series.name = name;
      series.y = *values;
      for (std::size_t k = 0; k < values->size(); ++k)
        series.x.push_back(static_cast<double>(k + 1));
      series.is_dashed = true;
      figure.series.push_back(std::move(series));
    }
    figure.note += " An honest covariance keeps the mean within the dashed lines.";
    return;
  }
}

void add_curves(const PointSummary& point, std::vector<Figure>& figures) {
  for (const CurveKind& kind : kCurves) {
    for (const auto& [group, unit] : groups_of(point, kind.name)) {
      Figure figure;
      const std::string label = point_label(point);
      figure.name = figure_name(std::string(kind.name) + (group.empty() ? "" : "_" + group) +
                                (label.empty() ? "" : "_" + label));
      figure.title = std::string(kind.title) + (group.empty() ? "" : ", " + group) +
                     (label.empty() ? "" : " (" + label + ")");
      figure.x_label = "step";
      figure.y_label = label_with_unit(kind.title, unit);
      figure.series = curve_series(point, kind.name, group);
      figure.note =
          "Bands: two standard errors to each side, " + std::to_string(point.num_runs) + " runs.";
      add_expected_band(point, kind.name, figure);
      figures.push_back(std::move(figure));
    }
  }
}

void add_rocs(const PointSummary& point, std::vector<Figure>& figures) {
  std::set<std::string> kinds;
  for (const EstimatorSummary& estimator : point.estimators)
    for (const RocCurve& roc : estimator.metrics.rocs) kinds.insert(roc.name);
  for (const std::string& kind : kinds) {
    Figure figure;
    const std::string label = point_label(point);
    figure.name = figure_name("roc_" + kind + (label.empty() ? "" : "_" + label));
    figure.title = "Detection of attacked " + kind + (label.empty() ? "" : " (" + label + ")");
    figure.x_label = "false-alarm rate";
    figure.y_label = "detection rate";
    for (const EstimatorSummary& estimator : point.estimators) {
      for (const RocCurve& roc : estimator.metrics.rocs) {
        if (roc.name != kind) continue;
        FigureSeries series;
        series.name = estimator.metrics.estimator + " (area " + number_text(roc.area, 3) + ")";
        series.x = roc.false_alarm_rate;
        series.y = roc.detection_rate;
        figure.series.push_back(std::move(series));
      }
    }
    figures.push_back(std::move(figure));
  }
}

// The one key that all points set, with its values; empty when they set several.
std::string swept_key(const CampaignSummary& summary, std::vector<std::string>& values) {
  std::string key;
  for (const PointSummary& point : summary.points) {
    if (point.settings.size() != 1) return "";
    const std::string& setting = point.settings.front();
    const std::string here = setting.substr(0, setting.find('='));
    if (!key.empty() && key != here) return "";
    key = here;
    values.push_back(setting.substr(setting.find('=') + 1));
  }
  return key;
}

using MetricId = std::tuple<std::string, std::string, std::string>;  // name, group, unit

// Metrics that any estimator has at any point, in the order of their first appearance.
std::vector<MetricId> metrics_of(const std::vector<PointSummary>& points) {
  std::vector<MetricId> all;
  for (const PointSummary& point : points) {
    for (const EstimatorSummary& estimator : point.estimators) {
      for (const Metric& metric : estimator.metrics.metrics) {
        const MetricId id(metric.name, metric.group, metric.unit);
        if (std::ranges::find(all, id) == all.end()) all.push_back(id);
      }
    }
  }
  return all;
}

// Which point stands at which x, where the axis does not say it.
std::string point_list(const CampaignSummary& summary) {
  constexpr std::size_t kShownMax = 20;
  std::string list = " Points:";
  for (std::size_t p = 0; p < std::min(kShownMax, summary.points.size()); ++p)
    list += " " + std::to_string(p + 1) + ": " + point_label(summary.points[p]) + ";";
  return list + (summary.points.size() > kShownMax ? " ..." : "");
}

void add_sweeps(const CampaignSummary& summary, std::vector<Figure>& figures) {
  if (summary.points.size() < 2) return;
  std::vector<std::string> values;
  const std::string key = swept_key(summary, values);
  const bool has_numbers = !key.empty() && std::ranges::all_of(values, is_number);
  std::vector<double> x(summary.points.size());
  std::iota(x.begin(), x.end(), 1.0);
  if (has_numbers) x = axis_of(values);
  for (const auto& [name, group, unit] : metrics_of(summary.points)) {
    Figure figure;
    figure.name = figure_name("sweep_" + name + (group.empty() ? "" : "_" + group));
    figure.title = name + (group.empty() ? "" : ", " + group) + " over the sweep";
    figure.x_label = has_numbers ? key : "sweep point";
    figure.y_label = label_with_unit(name, unit);
    figure.series = sweep_series(summary, x, name, group);
    figure.note = "Bands: two standard errors to each side.";
    if (is_chi_square(name)) show_on_log(figure);
    if (!has_numbers) {
      // Nothing lies between points that no number orders.
      for (FigureSeries& series : figure.series) series.style = FigureSeries::Style::kPoints;
      figure.note += point_list(summary);
    }
    figures.push_back(std::move(figure));
  }
}

}  // namespace

std::vector<FigureSeries> curve_series(const PointSummary& point, const std::string& curve,
                                       const std::string& group) {
  std::vector<FigureSeries> all;
  for (const EstimatorSummary& estimator : point.estimators) {
    const MetricCurve* found = find_curve(estimator.metrics, curve, group);
    if (found == nullptr) continue;
    FigureSeries series;
    series.name = estimator.metrics.estimator;
    for (std::size_t k = 0; k < found->value.size(); ++k) {
      add_with_band(series, static_cast<double>(k + 1), found->value[k],
                    k < found->standard_error.size() ? found->standard_error[k] : 0.0);
    }
    all.push_back(std::move(series));
  }
  return all;
}

std::vector<FigureSeries> sweep_series(const CampaignSummary& summary, const std::vector<double>& x,
                                       const std::string& metric, const std::string& group) {
  // By rising x, so that the line does not run back.
  std::vector<std::size_t> order(summary.points.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&x](std::size_t a, std::size_t b) { return x[a] < x[b]; });
  std::vector<FigureSeries> all;
  for (const std::size_t p : order) {
    for (const EstimatorSummary& estimator : summary.points[p].estimators) {
      const Metric* found = find_metric(estimator.metrics, metric, group);
      if (found == nullptr) continue;
      const auto same = std::ranges::find(all, estimator.metrics.estimator, &FigureSeries::name);
      FigureSeries& series = same == all.end() ? all.emplace_back() : *same;
      series.name = estimator.metrics.estimator;
      add_with_band(series, x[p], found->value, found->standard_error);
    }
  }
  return all;
}

std::vector<double> axis_of(const std::vector<std::string>& values) {
  std::vector<double> axis;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double value = std::strtod(values[i].c_str(), nullptr);
    axis.push_back(is_number(values[i]) ? value : static_cast<double>(i + 1));
  }
  return axis;
}

Report campaign_report(const CampaignSummary& summary) {
  Report report;
  report.title = "Campaign " + summary.scenario;
  report.subtitle = "seed " + std::to_string(summary.seed) + ", kernel " + summary.kernel +
                    ", version " + summary.version + ", commit " + summary.commit;
  report.tables.push_back(comparison_table(summary.points));
  add_sweeps(summary, report.figures);
  if (summary.points.size() <= kPointsShownMax) {
    for (const PointSummary& point : summary.points) {
      report.tables.push_back(metric_table(point));
      add_curves(point, report.figures);
      add_rocs(point, report.figures);
    }
  } else {
    report.tables.back().note += " With more than " + std::to_string(kPointsShownMax) +
                                 " points, curves over the steps and the other metrics of each "
                                 "point are left out here; --csv has them.";
  }
  return report;
}

}  // namespace holdfast
