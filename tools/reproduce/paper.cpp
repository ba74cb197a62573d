#include "tools/reproduce/paper.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <utility>

#include "common/configuration.h"

namespace holdfast {
namespace {

constexpr Interval kRuns{1.0, 1e9};

PaperCampaign read_campaign(ConfigurationMap& map, const std::string& folder) {
  PaperCampaign campaign;
  map.require("name");
  map.read("name", campaign.name);
  map.require("scenario");
  map.read("scenario", campaign.scenario);
  campaign.scenario = (std::filesystem::path(folder) / campaign.scenario).lexically_normal();
  map.read("set", campaign.settings);
  map.read("runs", campaign.runs, kRuns);
  campaign.runs_max = campaign.runs;
  map.read("runs_max", campaign.runs_max, {static_cast<double>(campaign.runs), 1e9});
  map.read("quick_runs", campaign.quick_runs, kRuns);
  if (map.has("sweep")) {
    ConfigurationMap sweep = map.map("sweep");
    sweep.require("key");
    sweep.read("key", campaign.sweep_key);
    sweep.require("values");
    sweep.read("values", campaign.sweep_values);
    campaign.sweep_labels = campaign.sweep_values;
    sweep.read("labels", campaign.sweep_labels);
    if (campaign.sweep_labels.size() != campaign.sweep_values.size())
      sweep.problem("labels", "must be as many as the values");
  }
  return campaign;
}

// First point and number of points of the campaign's sweep that a row is about: all of them, or the
// one of this label.
std::pair<std::size_t, std::size_t> points_of(ConfigurationMap& map, const Paper& paper,
                                              const std::string& campaign_name) {
  const auto campaign =
      std::find_if(paper.campaigns.begin(), paper.campaigns.end(),
                   [&](const PaperCampaign& other) { return other.name == campaign_name; });
  std::string label;
  map.read("point", label);
  if (campaign == paper.campaigns.end()) {
    map.problem("campaign", "'" + campaign_name + "' is none of this paper's campaigns");
    return {0, 1};
  }
  const std::vector<std::string>& labels = campaign->sweep_labels;
  if (label.empty()) return {0, std::max<std::size_t>(1, labels.size())};
  const auto found = std::find(labels.begin(), labels.end(), label);
  if (found == labels.end()) map.problem("point", "the sweep has no '" + label + "'");
  return {found == labels.end() ? 0 : static_cast<std::size_t>(found - labels.begin()), 1};
}

// One row, or one for each point of the sweep where `references` lists several.
void read_row(ConfigurationMap& map, const Paper& paper, PaperTable& table,
              const std::string& table_campaign, std::int64_t reference_runs, bool is_judged) {
  PaperRow row;
  row.campaign = table_campaign;
  row.reference_runs = reference_runs;
  map.read("campaign", row.campaign);
  map.require("estimator");
  map.read("estimator", row.estimator);
  map.require("group");
  map.read("group", row.group);
  map.read("metric", row.metric);
  map.read("label", row.label);
  map.read("control", row.is_control);
  if (map.has("band_max")) map.read("band_max", row.band_max, kPositive);
  std::vector<double> references, papers, errors, range;
  const auto [first_point, num_points] = points_of(map, paper, row.campaign);
  if (map.has("between")) {
    map.read("between", range, 2);
    if (map.has("references")) map.problem("between", "stands in the place of references");
  } else if (is_judged) {
    map.require("references");
  }
  if (range.size() == 2) {
    row.lowest = range[0], row.highest = range[1];
    if (row.highest < row.lowest) map.problem("between", "its second number is below its first");
  }
  if (map.has("references")) map.read_shared("references", references, num_points);
  if (map.has("standard_errors"))
    map.read_shared("standard_errors", errors, num_points, kNonNegative);
  if (map.has("papers")) map.read_shared("papers", papers, num_points);
  for (std::size_t point = 0; point < num_points; ++point) {
    row.point = static_cast<std::int64_t>(first_point + point);
    if (point < references.size()) row.reference = references[point];
    if (point < errors.size()) row.standard_error = errors[point];
    if (point < papers.size()) row.paper = papers[point];
    table.rows.push_back(row);
  }
}

PaperTable read_table(ConfigurationMap& map, const Paper& paper, bool is_judged) {
  PaperTable table;
  map.require("name");
  map.read("name", table.name);
  map.read("title", table.title);
  table.chosen_by_us = paper.chosen_by_us;
  map.read("chosen_by_us", table.chosen_by_us);
  std::string campaign;
  map.read("campaign", campaign);
  std::int64_t reference_runs = 400;
  map.read("reference_runs", reference_runs, kRuns);
  for (ConfigurationMap& row : map.maps("rows"))
    read_row(row, paper, table, campaign, reference_runs, is_judged);
  return table;
}

PaperFigure read_figure(ConfigurationMap& map, const Paper& paper) {
  PaperFigure figure;
  map.require("name");
  map.read("name", figure.name);
  map.read("title", figure.title);
  map.read_choice("kind", figure.kind,
                  {{"curve", PaperFigure::Kind::kCurve},
                   {"sweep", PaperFigure::Kind::kSweep},
                   {"path", PaperFigure::Kind::kPath},
                   {"readings", PaperFigure::Kind::kReadings},
                   {"states", PaperFigure::Kind::kStates},
                   {"attack", PaperFigure::Kind::kAttack},
                   {"modes", PaperFigure::Kind::kModes},
                   {"packets", PaperFigure::Kind::kPackets}});
  map.require("campaign");
  map.read("campaign", figure.campaign);
  const bool is_known = std::any_of(paper.campaigns.begin(), paper.campaigns.end(),
                                    [&](const auto& c) { return c.name == figure.campaign; });
  if (!is_known)
    map.problem("campaign", "'" + figure.campaign + "' is none of this paper's campaigns");
  figure.metric = figure.kind == PaperFigure::Kind::kSweep ? "rmse_step_mean" : "rmse_over_runs";
  map.read("metric", figure.metric);
  map.read("group", figure.group);
  map.read("x_label", figure.x_label);
  map.read("y_label", figure.y_label);
  map.read("estimators", figure.estimators);
  map.read("run", figure.run, kNonNegative);
  std::vector<double> sources;
  map.read("sources", sources, 0, kNonNegative);
  for (const double source : sources) figure.sources.push_back(std::llround(source));
  return figure;
}

}  // namespace

const PaperCampaign& Paper::campaign(const std::string& campaign_name) const {
  for (const PaperCampaign& campaign : campaigns)
    if (campaign.name == campaign_name) return campaign;
  throw UsageError(name + ": no campaign '" + campaign_name + "'");
}

Paper load_paper(const std::string& file) {
  ConfigurationDocument document = ConfigurationDocument::from_file(file);
  ConfigurationMap root = document.root();
  Paper paper;
  std::int64_t schema = 0;
  root.require("holdfast_paper");
  root.read("holdfast_paper", schema, {1.0, 1.0});
  root.require("name");
  root.read("name", paper.name);
  root.read("title", paper.title);
  root.read("chosen_by_us", paper.chosen_by_us);
  const std::string folder = std::filesystem::path(file).parent_path();
  for (ConfigurationMap& map : root.maps("campaigns"))
    paper.campaigns.push_back(read_campaign(map, folder));
  for (ConfigurationMap& map : root.maps("tables"))
    paper.tables.push_back(read_table(map, paper, true));
  for (ConfigurationMap& map : root.maps("figures"))
    paper.figures.push_back(read_figure(map, paper));
  for (ConfigurationMap& map : root.maps("choices"))
    paper.choices.push_back(read_table(map, paper, false));
  document.finish();
  return paper;
}

Paper only(const Paper& paper, const std::string& name) {
  Paper part = paper;
  const auto is_other = [&name](const auto& item) { return item.name != name; };
  std::erase_if(part.tables, is_other);
  std::erase_if(part.figures, is_other);
  std::erase_if(part.choices, is_other);
  if (part.tables.empty() && part.figures.empty() && part.choices.empty()) {
    std::string names;
    for (const PaperTable& table : paper.tables) names += " " + table.name;
    for (const PaperFigure& figure : paper.figures) names += " " + figure.name;
    for (const PaperTable& table : paper.choices) names += " " + table.name;
    throw UsageError(paper.name + " has no table or figure '" + name + "'; it has:" + names);
  }
  std::set<std::string> used;
  for (const auto* tables : {&part.tables, &part.choices})
    for (const PaperTable& table : *tables)
      for (const PaperRow& row : table.rows) used.insert(row.campaign);
  for (const PaperFigure& figure : part.figures) used.insert(figure.campaign);
  std::erase_if(part.campaigns, [&used](const auto& c) { return !used.contains(c.name); });
  return part;
}

}  // namespace holdfast
