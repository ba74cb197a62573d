// write_demo FOLDER: writes page.html (charts), pictures.html (the page of a build without the
// plotting library), and the figures as svg/ and png/.
#include <fstream>
#include <iostream>
#include <sstream>

#include "tests/system/report/demo_report.h"
#include "tools/report/figure_data.h"
#include "tools/report/html_page.h"
#include "tools/report/report_page.h"

namespace {

std::string read_file(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: write_demo FOLDER\n";
    return 2;
  }
  if (!holdfast::has_interactive_report()) {
    std::cerr << "write_demo: this build lacks uPlot: run scripts/setup --test and build again\n";
    return 1;
  }
  const std::filesystem::path folder = argv[1];
  std::filesystem::create_directories(folder);
  const holdfast::Report report = holdfast::testing::demo_report();
  std::ofstream(folder / "page.html", std::ios::binary) << holdfast::report_page(report);
  holdfast::write_figures(report.figures, folder / "svg", "svg");
  holdfast::write_figures(report.figures, folder / "png", "png");
  std::vector<std::string> pictures;
  for (const std::string& name : holdfast::file_names(report.figures)) {
    pictures.push_back(read_file(folder / "svg" / (name + ".svg")));
  }
  std::ofstream(folder / "pictures.html", std::ios::binary)
      << holdfast::static_page(report, pictures);
}
