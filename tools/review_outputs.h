#pragma once

#include <string>
#include <vector>

namespace holdfast {

/// Where a review goes besides the tables; empty: nowhere.
struct ReviewOutputs {
  std::string json_file;  // "-": standard output, instead of the tables
  std::string folder;     // review.txt, review.json, report.html, path.svg
  std::string labels_file, csv_folder, report_file, figures_folder;
  std::string figure_format = "svg";
};

/// Reviews logs and writes what is asked for, tables to standard output. Several logs of one
/// scenario also get metrics over all of them. Throws UsageError and JobError.
void review_logs(const std::vector<std::string>& logs, const ReviewOutputs& outputs);

}  // namespace holdfast
