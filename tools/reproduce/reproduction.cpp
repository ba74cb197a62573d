#include "tools/reproduce/reproduction.h"

#include <algorithm>
#include <cmath>

#include "tools/campaign/campaign.h"
#include "tools/text_table.h"

namespace holdfast {
namespace {

struct CampaignOutcome {
  CampaignPlan plan;
  CampaignSummary summary;
};

CampaignPlan plan_of(const PaperCampaign& campaign) {
  Sweep sweep;
  if (!campaign.sweep_key.empty())
    sweep.grid.push_back({campaign.sweep_key, campaign.sweep_values});
  return load_campaign_plan(campaign.scenario, campaign.settings, sweep);
}

// Rows of the campaign that more runs could tell.
bool wants_more_runs(const Paper& paper, const PaperCampaign& campaign,
                     const CampaignSummary& summary) {
  for (const PaperTable& table : paper.tables) {
    for (const PaperRow& row : table.rows) {
      if (row.campaign != campaign.name) continue;
      const RowResult result = evaluate(row, campaign, summary);
      if (result.verdict == Verdict::kCannotTell && !result.is_reference_too_wide()) return true;
    }
  }
  return false;
}

CampaignOutcome run(const Paper& paper, const PaperCampaign& campaign,
                    const ReproductionOptions& options) {
  CampaignOutcome outcome{plan_of(campaign), {}};
  const std::string file = options.folder / ("campaign-" + campaign.name + "-" +
                                             outcome.plan.identity().substr(0, 8) + ".sqlite");
  CampaignStore store(file, outcome.plan);
  ProcessGroup group;
  CampaignOptions campaign_options;
  campaign_options.num_threads = options.num_threads;
  campaign_options.on_progress = [&](std::int64_t done, std::int64_t, std::int64_t all) {
    if (options.on_progress) options.on_progress(campaign.name, done, all);
  };
  std::int64_t runs = options.is_quick ? campaign.quick_runs : campaign.runs;
  while (true) {
    outcome.plan.num_runs = runs;
    run_campaign(outcome.plan, store, group, campaign_options);
    outcome.summary = summarise(store, {0, runs - 1}, options.num_threads);
    if (options.is_quick || runs >= campaign.runs_max ||
        !wants_more_runs(paper, campaign, outcome.summary))
      return outcome;
    runs = std::min(2 * runs, campaign.runs_max);
  }
}

std::vector<TableResult> evaluate_tables(const std::vector<PaperTable>& tables, const Paper& paper,
                                         const std::map<std::string, CampaignOutcome>& outcomes) {
  std::vector<TableResult> results;
  for (const PaperTable& table : tables) {
    TableResult result{table, {}};
    for (const PaperRow& row : table.rows)
      result.rows.push_back(
          evaluate(row, paper.campaign(row.campaign), outcomes.at(row.campaign).summary));
    results.push_back(std::move(result));
  }
  return results;
}

std::string verdict_cell(const RowResult& row, const std::string& chosen_by_us) {
  if (!row.is_judged) return "";
  std::string text = verdict_text(row.verdict, !chosen_by_us.empty());
  if (row.row.is_control)
    return text + (row.verdict == Verdict::kDiffers ? " (wrong on purpose)"
                                                    : " (wrong on purpose: SHOULD DIFFER)");
  if (row.verdict == Verdict::kCannotTell && row.is_reference_too_wide())
    text += " (reference too uncertain)";
  return text;
}

ReportTable report_table(const TableResult& result, bool is_quick) {
  ReportTable table;
  table.title = result.table.title;
  table.header = {"row", "paper", "reference", "ours ± s.e.", "verdict", "chosen by us", "runs"};
  if (is_quick) table.header.emplace_back("smallest deviation it could see");
  for (const RowResult& row : result.rows) {
    std::vector<std::string> cells = {
        row.label,
        number_text(row.row.paper),
        std::isnan(row.row.lowest)
            ? number_with_error(row.reference.value, row.reference.standard_error)
            : number_text(row.row.lowest) + " to " + number_text(row.row.highest),
        number_with_error(row.ours.value, row.ours.standard_error),
        verdict_cell(row, result.table.chosen_by_us),
        result.table.chosen_by_us,
        std::to_string(row.num_runs)};
    if (is_quick)
      cells.push_back(row.is_judged ? number_text(verdict_band(row.ours, row.reference), 2) : "");
    table.rows.push_back(std::move(cells));
  }
  return table;
}

std::vector<ReportTable> report_tables(const Reproduction& result, bool is_quick) {
  std::vector<ReportTable> tables;
  for (const TableResult& table : result.tables) tables.push_back(report_table(table, is_quick));
  for (const TableResult& table : result.choices) {
    tables.push_back(report_table(table, false));
    tables.back().note = "A choice of ours: shown, not judged.";
  }
  return tables;
}

std::string count_line(const Reproduction& result) {
  int num_agree = 0, num_differ = 0, num_open = 0, num_control = 0;
  for (const TableResult& table : result.tables) {
    for (const RowResult& row : table.rows) {
      if (row.row.is_control) {
        ++num_control;
      } else if (row.is_judged) {
        ++(row.verdict == Verdict::kAgrees    ? num_agree
           : row.verdict == Verdict::kDiffers ? num_differ
                                              : num_open);
      }
    }
  }
  return std::to_string(num_agree) + " rows agree, " + std::to_string(num_differ) + " differ, " +
         std::to_string(num_open) + " cannot be told; " + std::to_string(num_control) +
         " wrong on purpose, not counted.";
}

}  // namespace

RowResult evaluate(const PaperRow& row, const PaperCampaign& campaign,
                   const CampaignSummary& summary) {
  RowResult result;
  result.row = row;
  const PointSummary& point = summary.points.at(static_cast<std::size_t>(row.point));
  result.num_runs = point.num_runs;
  result.label = row.label.empty() ? campaign.name + ": " + row.estimator : row.label;
  if (!campaign.sweep_key.empty())
    result.label += ", " + campaign.sweep_labels[static_cast<std::size_t>(row.point)];
  if (row.metric != PaperRow().metric) result.label += ", " + row.metric;
  if (!row.group.empty()) result.label += ", " + row.group;
  for (const EstimatorSummary& estimator : point.estimators) {
    if (estimator.metrics.estimator != row.estimator) continue;
    const Metric* metric = find_metric(estimator.metrics, row.metric, row.group);
    if (metric == nullptr) continue;
    result.ours = {metric->value, metric->standard_error};
    // A share that never varied is known no better than to one event more or less.
    const bool is_whole = metric->value == 0.0 || metric->value == 1.0;
    if (is_whole && metric->standard_error == 0.0 && metric->count > 0)
      result.ours.standard_error = 1.0 / static_cast<double>(metric->count);
    if (!metric->unit.empty()) result.label += " [" + metric->unit + "]";
    result.reference = {row.reference, row.standard_error};
    if (!std::isnan(row.lowest)) {
      result.reference.value = std::clamp(metric->value, row.lowest, row.highest);
    }
    // Not stated: as large as ours, for as many runs as the reference had.
    if (std::isnan(row.standard_error)) {
      result.reference.standard_error =
          result.ours.standard_error *
          std::sqrt(static_cast<double>(point.num_runs) / static_cast<double>(row.reference_runs));
    }
    result.is_judged = !std::isnan(row.reference) || !std::isnan(row.lowest);
    result.verdict = compare(result.ours, result.reference, result.band_max());
    return result;
  }
  throw UsageError("campaign " + campaign.name + " has no " + row.metric + " of estimator '" +
                   row.estimator + "' in group '" + row.group + "'");
}

double RowResult::band_max() const {
  return std::isnan(row.band_max) ? widest_band(reference) : row.band_max;
}

bool RowResult::is_reference_too_wide() const {
  return holdfast::is_reference_too_wide(reference, band_max());
}

bool Reproduction::has_failed(bool is_quick) const {
  for (const TableResult& table : tables) {
    for (const RowResult& row : table.rows) {
      if (!row.is_judged) continue;
      const bool is_open = row.verdict == Verdict::kCannotTell && !row.is_reference_too_wide();
      if (row.row.is_control ? row.verdict != Verdict::kDiffers
                             : row.verdict == Verdict::kDiffers || (is_open && !is_quick))
        return true;
    }
  }
  return false;
}

Reproduction reproduce(const Paper& paper, const ReproductionOptions& options) {
  std::filesystem::create_directories(options.folder);
  std::map<std::string, CampaignOutcome> outcomes;
  for (const PaperCampaign& campaign : paper.campaigns)
    outcomes.emplace(campaign.name, run(paper, campaign, options));
  Reproduction result;
  result.tables = evaluate_tables(paper.tables, paper, outcomes);
  result.choices = evaluate_tables(paper.choices, paper, outcomes);
  for (const PaperFigure& figure : paper.figures) {
    const CampaignOutcome& outcome = outcomes.at(figure.campaign);
    result.figures.push_back(draw(figure, paper.campaign(figure.campaign), outcome.plan,
                                  outcome.summary, result.tables));
  }
  return result;
}

std::string to_markdown(const Paper& paper, const Reproduction& result, bool is_quick) {
  std::string text = "# " + paper.title + "\n";
  for (const ReportTable& table : report_tables(result, is_quick)) {
    text += "\n## " + table.title + "\n\n|";
    for (const std::string& cell : table.header) text += " " + cell + " |";
    text += "\n|";
    for (std::size_t i = 0; i < table.header.size(); ++i) text += "---|";
    text += "\n";
    for (const auto& row : table.rows) {
      text += "|";
      for (const std::string& cell : row) text += " " + cell + " |";
      text += "\n";
    }
    if (!table.note.empty()) text += "\n" + table.note + "\n";
  }
  return text + "\n" + count_line(result) + "\n";
}

Report to_report(const Paper& paper, const Reproduction& result, bool is_quick) {
  Report report;
  report.title = paper.title;
  report.subtitle = count_line(result) + (is_quick ? " Quick: few runs." : "");
  report.tables = report_tables(result, is_quick);
  report.figures = result.figures;
  return report;
}

}  // namespace holdfast
