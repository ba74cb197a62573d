#pragma once

#include <string>
#include <vector>

#include "tools/campaign/campaign_summary.h"
#include "tools/report/figure.h"

namespace holdfast {

/// Bands of all figures: this many standard errors to each side.
inline constexpr double kFigureBandErrors = 2.0;

/// A metric over the steps, one series for each estimator of a point that has it.
std::vector<FigureSeries> curve_series(const PointSummary& point, const std::string& curve,
                                       const std::string& group);

/// A metric over the points of a sweep, one series for each estimator; x: [points].
std::vector<FigureSeries> sweep_series(const CampaignSummary& summary, const std::vector<double>& x,
                                       const std::string& metric, const std::string& group);

/// Values as numbers; their places, from 1, where one is none.
std::vector<double> axis_of(const std::vector<std::string>& values);

/// A results file as a report: tables of estimators x points, sweeps, curves with bands, detection.
Report campaign_report(const CampaignSummary& summary);

}  // namespace holdfast
