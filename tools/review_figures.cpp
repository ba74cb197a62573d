#include "tools/review_figures.h"

#include <algorithm>
#include <cmath>

#include "tools/printable_text.h"
#include "tools/review_estimate_figures.h"
#include "tools/review_figure_parts.h"
#include "tools/review_run_figures.h"
#include "tools/review_tables.h"

namespace holdfast {
namespace {

FigureSeries curve_series(const std::string& name, const MetricCurve& curve) {
  FigureSeries series;
  series.name = name;
  for (std::size_t k = 0; k < curve.value.size(); ++k) {
    series.x.push_back(static_cast<double>(k + 1));
    series.y.push_back(curve.value[k]);
    const double error = k < curve.standard_error.size() ? curve.standard_error[k] : std::nan("");
    series.low.push_back(curve.value[k] - 2.0 * error);
    series.high.push_back(curve.value[k] + 2.0 * error);
  }
  return series;
}

}  // namespace

std::vector<Figure> log_figures(const ReviewedLog& log) {
  const FigureContext context = figure_context(log);
  std::vector<Figure> figures;
  for (const auto& part : {path_figures, state_figures, error_figures, attack_figures,
                           innovation_figures, frame_figures, loss_figures, time_figures}) {
    for (Figure& figure : part(context)) figures.push_back(std::move(figure));
  }
  return figures;
}

Report log_report(const ReviewedLog& log) {
  const RunReview& review = log.review;
  Report report;
  report.title = printable(review.name, 80);
  report.subtitle = printable(review.file) + ", seed " + std::to_string(review.seed) + ", run " +
                    std::to_string(review.run) + ", " + std::to_string(review.num_steps) +
                    " steps, scenario " + review.scenario_hash;
  for (const std::string& warning : review.warnings) report.warnings.push_back(printable(warning));
  report.tables = report_tables(review);
  report.figures = log_figures(log);
  return report;
}

Report combined_report(const CombinedReview& combined) {
  Report report;
  report.title = printable(combined.name, 80);
  report.subtitle =
      std::to_string(combined.files.size()) + " runs, scenario but for its seed " + combined.family;
  for (const std::string& note : combined.notes) report.warnings.push_back(printable(note));
  report.tables = combined_tables(combined);
  for (const EstimatorMetrics& estimator : combined.estimators) {
    for (const MetricCurve& curve : estimator.curves) {
      const std::string what = curve.group.empty() ? curve.name : curve.name + ' ' + curve.group;
      const std::string title = printable(what, 80);
      const auto is_same = [&title](const Figure& figure) { return figure.title == title; };
      auto figure = std::ranges::find_if(report.figures, is_same);
      if (figure == report.figures.end()) {
        report.figures.emplace_back();
        figure = report.figures.end() - 1;
        figure->name = figure_name(title);
        figure->title = title;
        figure->x_label = "step";
        figure->y_label =
            title + (curve.unit.empty() ? "" : " [" + printable(curve.unit, 20) + "]");
        figure->note = "Bands: mean over the runs ± 2 standard errors.";
      }
      if (figure->series.size() < kCurvesMax)
        figure->series.push_back(curve_series(printable(estimator.estimator, 40), curve));
    }
  }
  return report;
}

}  // namespace holdfast
