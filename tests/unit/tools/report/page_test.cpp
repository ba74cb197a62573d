#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/support/catch.h"
#include "tests/support/texts.h"
#include "tools/report/html_page.h"
#include "tools/report/page_json.h"
#include "tools/report/report_page.h"

using holdfast::Figure;
using holdfast::FigureSeries;
using holdfast::Report;
using holdfast::testing::mentions;
using nlohmann::json;

namespace {

const std::string kHostile = "</script><script>alert(1)</script>\"'&\xE2\x80\xA8<!--";

std::size_t count_of(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) {
    ++count;
  }
  return count;
}

Figure one_figure(const std::string& name) {
  Figure figure{"one", name, "time [s] " + name, "speed [m/s]"};
  figure.series = {{name, {0, 1, 2.5}, {1, std::nan(""), 3}, {0, std::nan(""), 2}, {2, 3, 4}}};
  figure.levels = {{0.5, name}};
  figure.spans = {{1.0, 2.0, name}};
  return figure;
}

}  // namespace

TEST_CASE("figures come back from the page's JSON") {
  Figure figure = one_figure("speed");
  figure.has_log_y = true;
  figure.series.push_back({"steps", {0, 1, 2.5}, {4, 5, 6}});
  figure.series.back().style = FigureSeries::Style::kSteps;
  figure.series.back().is_dashed = true;
  const json page = json::parse(holdfast::page_json({figure}));
  const json& read = page.at("figures").at(0);
  CHECK(read.at("title") == "speed");
  CHECK(read.at("x_label") == "time [s] speed");
  CHECK(read.at("log_y") == true);
  CHECK(read.at("equal") == false);
  CHECK(read.at("series").at(0).at("y") == json::parse("[1, null, 3]"));
  CHECK(read.at("series").at(0).at("low") == json::parse("[0, null, 2]"));
  CHECK(read.at("series").at(0).at("high") == json::parse("[2, 3, 4]"));
  CHECK(read.at("series").at(1).at("style") == "steps");
  CHECK(read.at("series").at(1).at("dashed") == true);
  CHECK_FALSE(read.at("series").at(1).contains("low"));
  CHECK(read.at("levels").at(0).at("y") == 0.5);
  CHECK(read.at("spans").at(0).at("to") == 2);
  // Both series have one x, written once.
  CHECK(page.at("x") == json::parse("[[0, 1, 2.5]]"));
  CHECK(read.at("series").at(1).at("x") == 0);
}

TEST_CASE("values keep six digits of their range, whatever they are added to") {
  FigureSeries series{"offset", {}, {}};
  for (int i = 0; i < 50; ++i) {
    series.x.push_back(1e6 + 0.001 * i * i);
    series.y.push_back(1e8 + std::sin(0.3 * i));
  }
  const json page = json::parse(holdfast::page_json({{"a", "", "", "", {series}}}));
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    const double x = page["x"][0][i], y = page["figures"][0]["series"][0]["y"][i];
    // Half a unit of the sixth digit of the range, 2; for x a hundredth of the smallest step.
    CHECK(std::fabs(y - series.y[i]) < 0.5e-5);
    CHECK(std::fabs(x - series.x[i]) < 1e-5);
  }
}

TEST_CASE("the page stays small: even steps are counted, values are short") {
  FigureSeries series{"long", {}, {}};
  for (int i = 0; i < 10'000; ++i) {
    series.x.push_back(0.01 * i);
    series.y.push_back(std::sin(0.37 * i));
  }
  const std::string text = holdfast::page_json({{"a", "", "", "", {series}}});
  const json axis = json::parse(text)["x"][0];
  CHECK(axis.at("count") == 10'000);
  CHECK(axis.at("step").get<double>() == Approx(0.01).epsilon(1e-12));
  // Sign, "0.", digits, comma: seven digits at most.
  CHECK(text.size() < 10'000 * 12);
}

TEST_CASE("a very long series is thinned") {
  FigureSeries series{"long", std::vector<double>(300'000), std::vector<double>(300'000, 1.0)};
  for (std::size_t i = 0; i < series.x.size(); ++i) series.x[i] = static_cast<double>(i * i);
  series.y[150'001] = 9.0;
  const json page = json::parse(holdfast::page_json({{"a", "", "", "", {series}}}));
  const json& y = page["figures"][0]["series"][0]["y"];
  CHECK(y.size() <= 200'000);
  CHECK(std::count(y.begin(), y.end(), json(9)) == 1);
}

TEST_CASE("hostile text cannot leave its place") {
  const std::string text = holdfast::page_json({one_figure(kHostile)});
  CHECK_FALSE(mentions(text, "<"));
  for (const char c : text) REQUIRE((c >= ' ' && c <= '~'));
  const json read = json::parse(text)["figures"][0];
  CHECK(read["title"].get<std::string>().rfind("</script><script>alert(1)</script>\"'&", 0) == 0);
  CHECK(read["series"][0]["name"] == read["title"]);

  Report report{kHostile, kHostile, {kHostile}, {}, {one_figure(kHostile)}};
  report.tables = {{kHostile, {kHostile}, {{kHostile}}, kHostile}};
  report.figures[0].note = kHostile;
  for (const bool is_interactive : {true, false}) {
    if (is_interactive && !holdfast::has_interactive_report()) continue;
    const std::string page = is_interactive ? holdfast::interactive_page(report)
                                            : holdfast::static_page(report, {kHostile});
    CHECK_FALSE(mentions(page, "<script>alert"));
    CHECK_FALSE(mentions(page, "<!--"));
    CHECK_FALSE(mentions(page, "\xE2\x80\xA8"));
    CHECK(mentions(page, "&lt;/script&gt;&lt;script&gt;alert(1)&lt;/script&gt;&quot;&#39;&amp;"));
    CHECK(count_of(page, "</script>") == (is_interactive ? 3 : 0));
    CHECK(count_of(page, "default-src 'none'") == 1);
    CHECK_FALSE(mentions(page, "unsafe-inline"));
  }
}

TEST_CASE("broken UTF-8 is replaced, not refused") {
  const std::string text = holdfast::page_json({one_figure("a\xFF\xC0z")});
  CHECK(json::parse(text)["figures"][0]["title"] == "a??z");
}

TEST_CASE("the page has its parts, in order") {
  if (!holdfast::has_interactive_report()) WARN("this build lacks uPlot: only the static page");
  Report report{"The title", "line 1\nline 2", {"first warning"}, {}, {one_figure("speed")}};
  report.tables = {{"Table A", {"name", "value"}, {{"x", "1.5"}, {"y", "-2"}}, "a note"}};
  const std::string page = holdfast::static_page(report, {"<svg/>"});
  std::size_t last = 0;
  for (const char* part :
       {"<h1>The title", "line 1\nline 2", "first warning", "Table A", "<th>name</th>",
        "<td class=\"number\">1.5", "a note", "href=\"#figure-1\"", "These are pictures",
        "id=\"figure-1\"", "data:image/svg+xml;base64,PHN2Zy8+\""}) {
    const std::size_t place = page.find(part);
    INFO(part);
    REQUIRE(place != std::string::npos);
    CHECK(place > last);
    last = place;
  }
  CHECK_FALSE(mentions(page, "<script"));
}

TEST_CASE("a figure without data says so") {
  const double nan = std::nan("");
  Report report{"t", "", {}, {}, {{"a", "empty", "x", "y", {{"s", {0, 1}, {nan, nan}}}}}};
  CHECK(mentions(holdfast::static_page(report, {""}), "no data"));
  report.figures[0].series[0].y[0] = 1.0;
  CHECK_FALSE(mentions(holdfast::static_page(report, {""}), "no data"));
}

TEST_CASE("the plotting library's licence stands in the page") {
  if (!holdfast::has_interactive_report()) return;
  const std::string page = holdfast::report_page({"t", "", {}, {}, {one_figure("a")}});
  // In the script, where it stays beside the code, and for the reader.
  CHECK(count_of(page, "Copyright (c) 2022 Leon Sorokin") == 2);
  CHECK(count_of(page, "The above copyright notice and this permission notice") == 2);
}
