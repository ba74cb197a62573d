#include "tools/path_plot.h"

#include <cmath>

#include "tests/support/catch.h"
#include "tools/printable_text.h"

namespace holdfast {
namespace {

// Every element that opens also closes, in order; enough of XML for what the plot writes.
bool is_well_formed(const std::string& xml) {
  std::vector<std::string> open;
  for (std::size_t at = xml.find('<'); at != std::string::npos; at = xml.find('<', at + 1)) {
    const std::size_t end = xml.find('>', at);
    if (end == std::string::npos) return false;
    const std::string tag = xml.substr(at + 1, end - at - 1);
    if (tag.find('<') != std::string::npos) return false;
    if (tag.front() == '/') {
      if (open.empty() || open.back() != tag.substr(1)) return false;
      open.pop_back();
    } else if (tag.back() != '/') {
      open.push_back(tag.substr(0, tag.find_first_of(" \n")));
    }
  }
  return open.empty();
}

PathPlot sample_plot() {
  PathPlot plot{"run", "x [m]", "y [m]", {}, {}, {{0, 0}, {30, 30}}};
  PlotPath estimate{"secure", {}};
  for (int k = 0; k < 100; ++k) {
    plot.truth.push_back({0.3 * k, 10.0 + std::sin(0.1 * k)});
    estimate.points.push_back({0.3 * k + 0.2, 10.0});
  }
  plot.estimates = {estimate};
  return plot;
}

TEST_CASE("the picture is well-formed, 720 wide, and the same each time") {
  const std::string svg = draw_path_plot(sample_plot());
  CHECK(is_well_formed(svg));
  CHECK_FALSE(is_well_formed(svg.substr(0, svg.size() - 8)));  // the check can fail
  CHECK(svg.find("width=\"720\"") != std::string::npos);
  CHECK(svg.find(">truth<") != std::string::npos);
  CHECK(svg.find(">start<") != std::string::npos);
  CHECK(svg.find(">sensor<") != std::string::npos);
  CHECK(svg.find("leaves the picture") == std::string::npos);
  CHECK(svg == draw_path_plot(sample_plot()));
}

TEST_CASE("text from a log cannot become markup") {
  PathPlot plot = sample_plot();
  plot.title = "</title><script>alert(1)</script>";
  plot.estimates[0].name = "a\"b'c&<\x01\xff";
  const std::string svg = draw_path_plot(plot);
  CHECK(is_well_formed(svg));
  CHECK(svg.find("<script") == std::string::npos);
  CHECK(svg.find("a&quot;b&#39;c&amp;&lt;\\x01?") != std::string::npos);
}

TEST_CASE("paths that run away, are not finite, stand still or are long do no harm") {
  PathPlot plot = sample_plot();
  plot.estimates.push_back(
      {"away", {{0, 0}, {1e300, -1e300}, {std::nan(""), 0}, {INFINITY, 1}, {5, 5}}});
  const std::string svg = draw_path_plot(plot);
  CHECK(is_well_formed(svg));
  CHECK(svg.find("away (leaves the picture)") != std::string::npos);
  CHECK(svg.find("nan") == std::string::npos);
  CHECK(svg.find("inf") == std::string::npos);

  CHECK(is_well_formed(draw_path_plot({})));
  CHECK(is_well_formed(draw_path_plot({"still", "x", "y", {{1e9, -1e9}, {1e9, -1e9}}, {}, {}})));
  PathPlot long_plot{"long", "x", "y", std::vector<PlotPoint>(1000000, PlotPoint{1, 2}), {}, {}};
  long_plot.truth.back() = {3, 4};
  CHECK(draw_path_plot(long_plot).size() < 100000);
}

TEST_CASE("printable text keeps UTF-8 and nothing that moves a cursor") {
  CHECK(printable("plain \xc2\xb5m \xe2\x82\xac") == "plain \xc2\xb5m \xe2\x82\xac");
  CHECK(printable("\x1b[31m\n") == "\\x1b[31m\\x0a");
  CHECK(printable("\xc2\x9b") == "\\x9b");  // C1 control sequence introducer
  CHECK(printable("\xe2\x80\xae") == "?");  // right-to-left override
  CHECK(printable("\xc0\xaf\xed\xa0\x80\xff\xe2\x82") == "????????");  // overlong, surrogate, cut
  CHECK(printable(std::string(1000, 'a'), 10) == "aaaaaaaaaa...");
  CHECK(text_width("\xc2\xb5m") == 2);
}

}  // namespace
}  // namespace holdfast
