#include <iostream>

#include "tools/log_compare.h"
#include "tools/program_options.h"
#include "tools/review_report.h"

namespace holdfast {
namespace {

constexpr const char* kExamples =
    "Examples:\n"
    "  holdfast-review runs/binary_tracking/log.lcm\n"
    "  holdfast-review run.lcm --json -                       # JSON on standard output, no table\n"
    "  holdfast-review run.lcm --out report --labels labels.csv\n"
    "  holdfast-review --compare live.lcm replay.lcm          # exit 0 only when equal to the bit\n"
    "  holdfast-review --compare a.lcm b.lcm --channels 'EST_.*|MEASUREMENT'\n"
    "Exit status: 0 fine or equal, 1 not equal or cannot write, 2 wrong use or wrong file.";

struct ReviewOptions {
  std::vector<std::string> logs, compared;
  std::string json_file, folder, labels_file;
  CompareOptions compare;
};

int compare(const ReviewOptions& options) {
  const CompareResult result =
      compare_logs(options.compared[0], options.compared[1], options.compare);
  std::cout << result.text();
  return result.is_equal ? 0 : 1;
}

void write_json(const std::string& file, const std::vector<RunReview>& reviews) {
  std::string text;
  if (reviews.size() == 1) {
    text = review_json(reviews.front());
  } else {
    for (const RunReview& review : reviews)
      text += (text.empty() ? "[\n" : ",\n") + review_json(review);
    text += "]\n";
  }
  if (file == "-") {
    std::cout << text;
  } else {
    write_text_file(file, text);
  }
}

int review(const ReviewOptions& options) {
  if (options.logs.empty())
    throw UsageError("no log given; try: holdfast-review runs/NAME/log.lcm, or --help");
  if (options.logs.size() > 1 && (!options.folder.empty() || !options.labels_file.empty())) {
    throw UsageError("--out and --labels take one log; run them once for each");
  }
  std::vector<RunReview> reviews;
  for (const std::string& log : options.logs) reviews.push_back(review_log(log));
  for (std::size_t i = 0; i < reviews.size() && options.json_file != "-"; ++i) {
    std::cout << (i == 0 ? "" : "\n") << review_table(reviews[i]);
  }
  if (!options.folder.empty()) write_review_report(reviews.front(), options.folder);
  if (!options.labels_file.empty()) write_labels_csv(reviews.front(), options.labels_file);
  if (!options.json_file.empty()) write_json(options.json_file, reviews);
  return 0;
}

}  // namespace
}  // namespace holdfast

int main(int argc, char** argv) {
  CLI::App app{
      "Reviews logs of runs: errors against the truth, outcomes, frames, losses, times; or "
      "compares two logs."};
  app.footer(holdfast::kExamples);
  holdfast::ReviewOptions options;
  auto* logs = app.add_option("LOG", options.logs, "Logs to review, one table each");
  app.add_option("--json", options.json_file,
                 "Also write the review as JSON; '-': to standard output instead of the table");
  app.add_option("--out", options.folder,
                 "Also write review.txt, review.json and path.svg to this folder");
  app.add_option("--labels", options.labels_file, "Also write the label of each packet as CSV");
  auto* compared = app.add_option("--compare", options.compared, "Compare two logs instead")
                       ->expected(2)
                       ->excludes(logs);
  app.add_option("--channels", options.compare.channels,
                 "Channels to compare, a regular expression")
      ->capture_default_str()
      ->needs(compared);
  const int status = holdfast::parse_command_line(app, "holdfast-review", argc, argv);
  if (status >= 0) return status;
  return holdfast::run_program("holdfast-review", [&] {
    return options.compared.empty() ? holdfast::review(options) : holdfast::compare(options);
  });
}
