#include "tools/report/report_page.h"

#include <stdlib.h>

#include <fstream>
#include <sstream>
#include <system_error>

#include "common/errors.h"
#include "tools/report/figure_data.h"
#include "tools/report/gnuplot.h"
#include "tools/report/gnuplot_script.h"
#include "tools/report/html_page.h"
#include "tools/report/report_assets.h"

namespace holdfast {
namespace {

// A folder for pictures on their way into a page.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string name =
        (std::filesystem::temp_directory_path() / "holdfast-figures-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw JobError("cannot make a temporary folder: " + name);
    path_ = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

std::string read_file(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  if (!stream) throw JobError("cannot read " + path.string() + ", which gnuplot was to draw");
  return text.str();
}

void write_file(const std::filesystem::path& path, const std::string& text) {
  std::ofstream stream(path, std::ios::binary);
  stream << text;
  stream.close();
  if (!stream) throw JobError("cannot write " + path.string());
}

}  // namespace

bool has_interactive_report() {
  return !report_assets().uplot_script.empty();
}

std::string report_page(const Report& report) {
  if (has_interactive_report()) return interactive_page(report);
  if (!has_gnuplot() && !report.figures.empty()) {
    throw JobError(
        "cannot draw the report: this build lacks the plotting library (run scripts/setup where "
        "npm is, and build again), and gnuplot, which draws pictures instead, is not installed "
        "(Debian package gnuplot-nox)");
  }
  const ScratchFolder folder;
  write_figures(report.figures, folder.path(), "svg");
  std::vector<std::string> pictures;
  for (const std::string& name : file_names(report.figures)) {
    pictures.push_back(read_file(folder.path() / (name + ".svg")));
  }
  return static_page(report, pictures);
}

void write_figures(const std::vector<Figure>& figures, const std::filesystem::path& folder,
                   const std::string& format) {
  if (format != "svg" && format != "png") {
    throw UsageError("figures are written as svg or png, not as '" + format + "'");
  }
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw JobError("cannot make the folder " + folder.string() + ": " + error.message());
  const std::vector<std::string> names = file_names(figures);
  for (std::size_t i = 0; i < figures.size(); ++i) {
    write_file(folder / (names[i] + ".gp"), gnuplot_script(figures[i], names[i], format));
    run_gnuplot(folder, names[i] + ".gp");
  }
}

}  // namespace holdfast
