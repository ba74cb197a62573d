#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "tools/campaign/campaign_summary.h"
#include "tools/report/figure.h"

namespace holdfast {

/// A campaign of more points than this is shown as a whole; its points are left to the CSV.
inline constexpr std::size_t kPointsShownMax = 6;

/// What tells a point from the others, printable; empty for a campaign without a sweep.
std::string point_label(const PointSummary& point);
/// "name [unit]", printable; the name alone when there is no unit.
std::string label_with_unit(const std::string& name, const std::string& unit);

/// RMSE of each estimator and group at each point, with paired differences.
ReportTable comparison_table(std::span<const PointSummary> points);
/// Every metric of a point, a column for each estimator.
ReportTable metric_table(const PointSummary& point);

/// The campaign as aligned text, with step times.
std::string to_text(const CampaignSummary& summary);
/// One row for each point, estimator and metric.
std::string to_csv(const CampaignSummary& summary);
/// One row for each point, estimator, curve and step.
std::string curves_to_csv(const CampaignSummary& summary);

}  // namespace holdfast
