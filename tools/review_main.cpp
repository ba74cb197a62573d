#include <algorithm>
#include <iostream>

#include "common/log_file.h"
#include "tools/campaign/campaign_review.h"
#include "tools/campaign/sqlite_database.h"
#include "tools/log_compare.h"
#include "tools/program_options.h"
#include "tools/review_outputs.h"

namespace holdfast {
namespace {

constexpr const char* kExamples =
    "Examples:\n"
    "  holdfast-review runs/binary_tracking-20260101T120000Z   # a run's folder, or its log\n"
    "  holdfast-review run.lcm --json -                       # JSON on standard output, no table\n"
    "  holdfast-review run.lcm --report run.html              # one page, opens offline\n"
    "  holdfast-review run.lcm --figures figures --format png # one picture each, for a paper\n"
    "  holdfast-review run.lcm --csv csv                      # one table for each channel\n"
    "  holdfast-review run.lcm --out report --labels labels.csv\n"
    "  holdfast-review run0.lcm run1.lcm run2.lcm             # also metrics over all of them\n"
    "  holdfast-review runs/campaign-NAME-HASH.sqlite --report campaign.html\n"
    "  holdfast-review --compare live.lcm replay.lcm          # exit 0 only when equal to the bit\n"
    "  holdfast-review --compare a.lcm b.lcm --channels 'EST_.*|MEASUREMENT'\n"
    "Exit status: 0 fine or equal, 1 not equal or cannot write, 2 wrong use or wrong file.";

struct ReviewOptions {
  std::vector<std::string> logs, compared;
  ReviewOutputs outputs;
  CompareOptions compare;
};

int compare(const ReviewOptions& options) {
  const auto num_campaigns = std::ranges::count_if(options.compared, is_sqlite_file);
  if (num_campaigns == 2)
    return compare_campaigns(options.compared[0], options.compared[1]) ? 0 : 1;
  if (num_campaigns == 1) throw UsageError("a log and a campaign cannot be compared");
  const CompareResult result =
      compare_logs(options.compared[0], options.compared[1], options.compare);
  std::cout << result.text();
  return result.is_equal ? 0 : 1;
}

int review(const ReviewOptions& options) {
  const auto num_campaigns = std::ranges::count_if(options.logs, is_sqlite_file);
  if (num_campaigns == 0) {
    review_logs(options.logs, options.outputs);
  } else if (num_campaigns == static_cast<std::ptrdiff_t>(options.logs.size())) {
    review_campaigns(options.logs, options.outputs);
  } else {
    throw UsageError("logs and results of campaigns together; review them one kind at a time");
  }
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
  holdfast::ReviewOutputs& outputs = options.outputs;
  auto* logs =
      app.add_option("LOG", options.logs, "Logs, or results files of campaigns, one table each");
  app.add_option("--json", outputs.json_file,
                 "Also write the review as JSON; '-': to standard output instead of the table");
  app.add_option("--out", outputs.folder,
                 "Also write review.txt, review.json, report.html and path.svg to this folder");
  app.add_option("--report", outputs.report_file,
                 "Also write a page with tables and figures to this HTML file");
  auto* figures =
      app.add_option("--figures", outputs.figures_folder,
                     "Also write each figure, and the gnuplot script that drew it, to this folder");
  app.add_option("--format", outputs.figure_format, "Of the figures: svg or png")
      ->check(CLI::IsMember({"svg", "png"}))
      ->capture_default_str()
      ->needs(figures);
  app.add_option("--csv", outputs.csv_folder,
                 "Also write a CSV for each channel to this folder (of several logs: 1, 2, ...)");
  app.add_option("--labels", outputs.labels_file, "Also write the label of each packet as CSV");
  auto* compared =
      app.add_option("--compare", options.compared, "Compare two logs, or two campaigns, instead")
          ->expected(2)
          ->excludes(logs);
  app.add_option("--channels", options.compare.channels,
                 "Channels to compare, a regular expression")
      ->capture_default_str()
      ->needs(compared);
  return holdfast::run_command_line(app, "holdfast-review", argc, argv, [&] {
    for (std::string& path : options.logs) path = holdfast::log_of_run(path);
    for (std::string& path : options.compared) path = holdfast::log_of_run(path);
    if (!options.compared.empty()) return holdfast::compare(options);
    return holdfast::review(options);
  });
}
