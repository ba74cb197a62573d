#include "tools/campaign/campaign_review.h"

#include <algorithm>
#include <filesystem>
#include <iostream>

#include "tools/campaign/campaign_figures.h"
#include "tools/campaign/campaign_summary.h"
#include "tools/campaign/campaign_table.h"
#include "tools/report/report_page.h"
#include "tools/review_report.h"

namespace holdfast {
namespace {

void write_csv(const CampaignSummary& summary, const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  write_text_file(folder / "metrics.csv", to_csv(summary));
  write_text_file(folder / "curves.csv", curves_to_csv(summary));
}

void write_folder(const CampaignSummary& summary, const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  write_text_file(folder / "review.txt", to_text(summary));
  write_text_file(folder / "review.json", to_json(summary));
  write_text_file(folder / "report.html", report_page(campaign_report(summary)));
}

}  // namespace

void review_campaigns(const std::vector<std::string>& files, const ReviewOutputs& outputs) {
  const bool writes = !outputs.json_file.empty() || !outputs.folder.empty() ||
                      !outputs.csv_folder.empty() || !outputs.report_file.empty() ||
                      !outputs.figures_folder.empty();
  if (!outputs.labels_file.empty())
    throw UsageError("--labels is for logs: a campaign keeps no frames");
  if (files.size() > 1 && writes)
    throw UsageError("of several campaigns only the tables can be shown; write files one by one");
  for (const std::string& file : files) {
    CampaignStore store(file);
    const CampaignSummary summary = summarise(store, {});
    if (outputs.json_file == "-") {
      std::cout << to_json(summary);
    } else {
      std::cout << (file == files.front() ? "" : "\n") << to_text(summary);
      if (!outputs.json_file.empty()) write_text_file(outputs.json_file, to_json(summary));
    }
    if (!outputs.folder.empty()) write_folder(summary, outputs.folder);
    if (!outputs.csv_folder.empty()) write_csv(summary, outputs.csv_folder);
    if (!outputs.report_file.empty())
      write_text_file(outputs.report_file, report_page(campaign_report(summary)));
    if (!outputs.figures_folder.empty())
      write_figures(campaign_report(summary).figures, outputs.figures_folder,
                    outputs.figure_format);
  }
}

bool compare_campaigns(const std::string& one, const std::string& other) {
  CampaignStore first(one), second(other);
  const std::string a = to_json(summarise(first, {})), b = to_json(summarise(second, {}));
  if (a == b) {
    std::cout << "equal: the aggregates of " << one << " and " << other << ", byte for byte\n";
    return true;
  }
  const auto place = std::mismatch(a.begin(), a.end(), b.begin(), b.end()).first;
  const auto line = 1 + std::count(a.begin(), place, '\n');
  std::cout << "not equal: the aggregates (--json) of " << one << " and " << other
            << " differ from line " << line << " on\n";
  return false;
}

}  // namespace holdfast
