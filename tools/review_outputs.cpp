#include "tools/review_outputs.h"

#include <algorithm>
#include <iostream>
#include <iterator>
#include <utility>

#include "common/errors.h"
#include "tools/log_csv.h"
#include "tools/printable_text.h"
#include "tools/report/report_page.h"
#include "tools/review_figures.h"
#include "tools/review_json.h"
#include "tools/review_report.h"
#include "tools/review_tables.h"

namespace holdfast {
namespace {

void write_csv(const std::vector<std::string>& logs, const std::string& folder) {
  for (std::size_t i = 0; i < logs.size(); ++i) {
    const std::string place = logs.size() == 1 ? folder : folder + '/' + std::to_string(i + 1);
    for (const std::string& note : write_channel_csv(logs[i], place).notes)
      std::cerr << "holdfast-review: " << note << '\n';
  }
}

void write_json(const std::string& file, const std::string& text) {
  if (file == "-") {
    std::cout << text;
  } else if (!file.empty()) {
    write_text_file(file, text);
  }
}

void write_report(const Report& report, const ReviewOutputs& outputs) {
  if (!outputs.report_file.empty()) write_text_file(outputs.report_file, report_page(report));
  if (!outputs.figures_folder.empty())
    write_figures(report.figures, outputs.figures_folder, outputs.figure_format);
}

bool wants_report(const ReviewOutputs& outputs) {
  return !outputs.report_file.empty() || !outputs.figures_folder.empty();
}

void review_one(const std::string& file, const ReviewOutputs& outputs) {
  const ReviewedLog log = read_reviewed_log(file);
  if (outputs.json_file != "-") std::cout << review_table(log.review);
  if (!outputs.folder.empty()) write_review_report(log, outputs.folder);
  if (!outputs.labels_file.empty()) write_labels_csv(log.review, outputs.labels_file);
  if (!outputs.json_file.empty()) write_json(outputs.json_file, review_json(log.review));
  if (wants_report(outputs)) write_report(log_report(log), outputs);
}

// One page for several logs: what they say together, then the errors of each.
Report report_of(const std::vector<RunReview>& reviews,
                 const std::vector<CombinedReview>& combined) {
  Report report;
  for (const CombinedReview& runs : combined) {
    Report part = combined_report(runs);
    report.title += (report.title.empty() ? "" : ", ") + part.title;
    report.subtitle += (report.subtitle.empty() ? "" : "; ") + part.subtitle;
    std::ranges::move(part.warnings, std::back_inserter(report.warnings));
    std::ranges::move(part.tables, std::back_inserter(report.tables));
    std::ranges::move(part.figures, std::back_inserter(report.figures));
  }
  if (report.title.empty()) report.title = std::to_string(reviews.size()) + " logs";
  for (const RunReview& review : reviews) {
    ReportTable table = error_table(review);
    table.title = printable(review.file) + ", seed " + std::to_string(review.seed) + ", run " +
                  std::to_string(review.run);
    if (!table.rows.empty()) report.tables.push_back(std::move(table));
    for (const std::string& warning : review.warnings)
      report.warnings.push_back(printable(review.file + ": " + warning));
  }
  return report;
}

void review_several(const std::vector<std::string>& logs, const ReviewOutputs& outputs) {
  std::vector<RunReview> reviews;
  for (const std::string& log : logs) reviews.push_back(review_log(log));
  const std::vector<CombinedReview> combined = combine_reviews(reviews);
  if (outputs.json_file != "-") {
    for (const RunReview& review : reviews) std::cout << review_table(review) << '\n';
    for (const CombinedReview& runs : combined) std::cout << combined_table(runs);
  }
  if (!outputs.json_file.empty()) write_json(outputs.json_file, reviews_json(reviews, combined));
  if (wants_report(outputs)) write_report(report_of(reviews, combined), outputs);
}

}  // namespace

void review_logs(const std::vector<std::string>& logs, const ReviewOutputs& outputs) {
  if (logs.empty())
    throw UsageError("no log given; try: holdfast-review runs/NAME/log.lcm, or --help");
  if (logs.size() > 1 && (!outputs.folder.empty() || !outputs.labels_file.empty()))
    throw UsageError("--out and --labels take one log; run them once for each");
  if (logs.size() == 1) {
    review_one(logs.front(), outputs);
  } else {
    review_several(logs, outputs);
  }
  if (!outputs.csv_folder.empty()) write_csv(logs, outputs.csv_folder);
}

}  // namespace holdfast
