#include <unistd.h>

#include <filesystem>
#include <iostream>

#include "tools/program_options.h"
#include "tools/report/report_page.h"
#include "tools/reproduce/reproduction.h"
#include "tools/review_report.h"

namespace holdfast {
namespace {

constexpr const char* kExamples =
    "Examples:\n"
    "  holdfast-reproduce scenarios/papers/binary_pf.yaml\n"
    "  holdfast-reproduce scenarios/papers/binary_pf.yaml --only table_2\n"
    "  holdfast-reproduce scenarios/papers/binary_pf.yaml --quick\n"
    "Exit status: 0 every row agrees and every row that is wrong on purpose differs; 1 otherwise "
    "(a\n"
    "row that cannot be told counts too, unless --quick); 2 wrong use or wrong file.";

struct Options {
  std::string paper, only, folder, format = "svg";
  ReproductionOptions reproduction;
};

int run(Options& options) {
  Paper paper = load_paper(options.paper);
  if (!options.only.empty()) paper = only(paper, options.only);
  options.reproduction.folder = options.folder.empty()
                                    ? std::filesystem::path("runs") / ("reproduce-" + paper.name)
                                    : std::filesystem::path(options.folder);
  if (isatty(STDERR_FILENO) != 0) {
    options.reproduction.on_progress = [](const std::string& name, std::int64_t done,
                                          std::int64_t all) {
      std::cerr << "\r\033[K" << name << ": run " << done << " of " << all << std::flush;
    };
  }
  const Reproduction result = reproduce(paper, options.reproduction);
  if (options.reproduction.on_progress) std::cerr << "\r\033[K";
  const bool is_quick = options.reproduction.is_quick;
  const std::string text = to_markdown(paper, result, is_quick);
  std::cout << text;
  const std::filesystem::path& folder = options.reproduction.folder;
  write_text_file(folder / (paper.name + ".md"), text);
  try {
    write_figures(result.figures, folder / "figures", options.format);
    write_text_file(folder / "report.html", report_page(to_report(paper, result, is_quick)));
    std::cout << "figures: " << (folder / "figures").string()
              << "\nreport:  " << (folder / "report.html").string() << "\n";
  } catch (const JobError& error) {
    std::cerr << "holdfast-reproduce: no figures: " << error.what() << "\n";
  }
  return result.has_failed(is_quick) ? 1 : 0;
}

}  // namespace
}  // namespace holdfast

int main(int argc, char** argv) {
  CLI::App app{
      "Runs a paper's figures and tables and compares every number with the paper's and with an "
      "independent reference."};
  app.footer(holdfast::kExamples);
  holdfast::Options options;
  app.add_option("PAPER", options.paper, "File of the paper (scenarios/papers/NAME.yaml)")
      ->required();
  app.add_option("--only", options.only, "Only this table or figure");
  app.add_flag("--quick", options.reproduction.is_quick,
               "Few runs; says what each row could have seen");
  app.add_option("--out", options.folder, "Folder for results [runs/reproduce-NAME]");
  app.add_option("--format", options.format, "Of the figures: svg or png")
      ->check(CLI::IsMember({"svg", "png"}))
      ->capture_default_str();
  app.add_option("--threads", options.reproduction.num_threads, "Threads [one per processor]")
      ->check(CLI::Range(1, 4096));
  return holdfast::run_command_line(app, "holdfast-reproduce", argc, argv,
                                    [&] { return holdfast::run(options); });
}
