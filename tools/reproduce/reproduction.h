#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "tools/campaign/campaign_summary.h"
#include "tools/report/figure.h"
#include "tools/reproduce/paper.h"
#include "tools/reproduce/verdict.h"

namespace holdfast {

struct ReproductionOptions {
  bool is_quick = false;  // few runs; what cannot be told is no failure
  int num_threads = 0;    // 0: one per processor
  std::filesystem::path folder;
  /// Told which campaign runs and how far it is. May be empty.
  std::function<void(const std::string&, std::int64_t, std::int64_t)> on_progress;
};

/// One row of a table with what came out.
struct RowResult {
  PaperRow row;
  std::string label;
  Uncertain ours, reference;
  std::int64_t num_runs = 0;
  Verdict verdict = Verdict::kCannotTell;
  bool is_judged = true;  // false: there is nothing to compare with

  double band_max() const;
  /// Cannot be told, and the reference is why.
  bool is_reference_too_wide() const;
};

struct TableResult {
  PaperTable table;
  std::vector<RowResult> rows;
};

/// What a paper's reproduction came to.
struct Reproduction {
  std::vector<TableResult> tables, choices;
  std::vector<Figure> figures;

  /// True when a row differs, a wrong-on-purpose row does not, or (unless quick) a row cannot be
  /// told although more runs could tell it.
  bool has_failed(bool is_quick) const;
};

/// Runs a paper's campaigns, each until every row can be told or its runs_max is reached, keeping
/// the runs in the folder, and compares. The number of runs depends on standard errors only, never
/// on whether a row agrees.
Reproduction reproduce(const Paper& paper, const ReproductionOptions& options);

/// The tables as Markdown.
std::string to_markdown(const Paper& paper, const Reproduction& result, bool is_quick);

/// Tables and figures as one report.
Report to_report(const Paper& paper, const Reproduction& result, bool is_quick);

/// Compares one row with a campaign's summary. Throws UsageError when the summary has no such
/// estimator, metric or group.
RowResult evaluate(const PaperRow& row, const PaperCampaign& campaign,
                   const CampaignSummary& summary);

/// Draws a figure from its campaign's summary and, where it wants single runs, the plan's scenario.
Figure draw(const PaperFigure& figure, const PaperCampaign& campaign, const CampaignPlan& plan,
            const CampaignSummary& summary, const std::vector<TableResult>& tables);

}  // namespace holdfast
