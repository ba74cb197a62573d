#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "common/errors.h"
#include "tests/support/catch.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/texts.h"
#include "tools/report/gnuplot.h"
#include "tools/report/gnuplot_script.h"
#include "tools/report/report_page.h"

using holdfast::Figure;
using holdfast::testing::mentions;
using holdfast::testing::TemporaryFolder;

namespace {

std::string read_file(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

// Everywhere that text of a log can get to.
Figure figure_with(const std::string& text) {
  Figure figure{"figure_a", text, text, text};
  figure.series = {
      {text, {0, 1, 2, 3}, {1, 2, std::nan(""), 3}, {0, 1, std::nan(""), 2}, {2, 3, 3, 4}}};
  figure.series.push_back({text, {0, 3}, {2, 2}, {}, {}, holdfast::FigureSeries::Style::kPoints});
  figure.levels = {{1.5, text}};
  figure.spans = {{0.5, 1.0, text}};
  figure.note = text;
  return figure;
}

// The environment's PATH is another one as long as this lives.
class Path {
 public:
  explicit Path(const std::string& value) : old_(std::getenv("PATH")) {
    setenv("PATH", value.c_str(), 1);
  }
  ~Path() { setenv("PATH", old_.c_str(), 1); }
  Path(const Path&) = delete;
  Path& operator=(const Path&) = delete;

 private:
  std::string old_;
};

}  // namespace

TEST_CASE("figures are written with their scripts, the same each time") {
  const TemporaryFolder folder;
  for (const std::string format : {"svg", "png"}) {
    holdfast::write_figures({figure_with("speed")}, folder.file("a/b"), format);
    const std::string first = read_file(folder.file("a/b/figure_a." + format));
    CHECK(mentions(first, format == "svg" ? "<svg" : "PNG"));
    std::filesystem::remove(folder.file("a/b/figure_a." + format));
    // The script alone draws it again.
    holdfast::run_gnuplot(folder.file("a/b"), "figure_a.gp");
    CHECK(read_file(folder.file("a/b/figure_a." + format)) == first);
  }
}

TEST_CASE("text from a log runs nothing in gnuplot") {
  const TemporaryFolder folder;
  const std::string target = folder.file("ran");
  const std::string command = "touch " + target;
  std::vector<Figure> figures;
  for (const std::string& text : std::vector<std::string>{
           "`" + command + "`", "\"`" + command + "`\"", "'`" + command + "`'",
           "'; system('" + command + "'); x = '", "\" ; system(\"" + command + "\") ; \"",
           "'\n!" + command + "\nset title '", "a\\", "@x", "%s %n", "{/Symbol a}",
           "END\n!" + command}) {
    figures.push_back(figure_with(text));
  }
  holdfast::write_figures(figures, folder.file("out"), "svg");
  CHECK_FALSE(std::filesystem::exists(target));
  for (int i = 1; i <= static_cast<int>(figures.size()); ++i) {
    const std::string name = i == 1 ? "figure_a" : "figure_a_" + std::to_string(i);
    CHECK(mentions(read_file(folder.file("out/" + name + ".svg")), "</svg>"));
  }
  // Shown as it is, not taken for markup.
  CHECK(mentions(read_file(folder.file("out/figure_a_10.svg")), "{/Symbol a}"));

  // The control: unguarded, such a title does run.
  std::ofstream(folder.file("open.gp")) << "set title \"`" << command << "`\"\n";
  holdfast::run_gnuplot(folder.file("."), "open.gp");
  CHECK(std::filesystem::exists(target));
}

TEST_CASE("text of a script stands in single quotes") {
  CHECK(holdfast::gnuplot_text("'b`c\"") ==
        "'\xE2\x80\x99"
        "b\xE2\x80\x99"
        "c\"'");
  CHECK(holdfast::gnuplot_text("a\nb\x1b") == "'a\\x0ab\\x1b'");
  CHECK(holdfast::gnuplot_text(std::string(1000, 'x')).size() < 150);
}

TEST_CASE("a figure without data, of one point, or of huge numbers is drawn too") {
  const TemporaryFolder folder;
  const double nan = std::nan("");
  std::vector<Figure> figures = {{"nothing", "", "", ""},
                                 {"nan", "", "", "", {{"a", {0, 1}, {nan, nan}}}},
                                 {"one", "", "", "", {{"a", {5}, {7}}}},
                                 {"zero", "", "", "", {{"a", {0}, {0}}}},
                                 {"huge", "", "", "", {{"a", {0, 1}, {-1e200, 1e200}}}},
                                 {"negative", "", "", "", {{"a", {0, 1}, {-1, -2}}}},
                                 {"map", "", "", "", {{"a", {1, 1}, {1, 1}}}}};
  figures[5].has_log_y = true;
  figures[6].has_equal_axes = true;
  holdfast::write_figures(figures, folder.file("out"), "svg");
  for (const Figure& figure : figures) {
    INFO(figure.name);
    CHECK(mentions(read_file(folder.file("out/" + figure.name + ".svg")), "</svg>"));
  }
  CHECK(mentions(read_file(folder.file("out/nan.svg")), "no data"));
  CHECK_FALSE(mentions(read_file(folder.file("out/one.svg")), "no data"));
}

TEST_CASE("a missing gnuplot is named with its package") {
  const TemporaryFolder folder;
  const Path path(folder.file("empty"));
  CHECK_FALSE(holdfast::has_gnuplot());
  try {
    holdfast::write_figures({figure_with("a")}, folder.file("out"), "svg");
    FAIL("no gnuplot, no error");
  } catch (const holdfast::JobError& error) {
    CHECK(mentions(error.what(), "gnuplot-nox"));
  }
}

TEST_CASE("wrong use and failures are told apart") {
  const TemporaryFolder folder;
  CHECK_THROWS_AS(holdfast::write_figures({}, folder.file("out"), "pdf"), holdfast::UsageError);
  std::ofstream(folder.file("file")) << "not a folder";
  CHECK_THROWS_AS(holdfast::write_figures({}, folder.file("file"), "svg"), holdfast::JobError);
  std::ofstream(folder.file("wrong.gp")) << "plot nonsense(\n";
  CHECK_THROWS_AS(holdfast::run_gnuplot(folder.file("."), "wrong.gp"), holdfast::JobError);
}
