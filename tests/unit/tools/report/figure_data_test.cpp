#include "tools/report/figure_data.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/support/catch.h"

using holdfast::Figure;
using holdfast::FigureSeries;

namespace {

const double kNan = std::nan("");

FigureSeries ramp(std::size_t size) {
  FigureSeries series{"ramp", {}, {}};
  for (std::size_t i = 0; i < size; ++i) {
    series.x.push_back(static_cast<double>(i));
    series.y.push_back(std::sin(0.01 * static_cast<double>(i)));
  }
  return series;
}

}  // namespace

TEST_CASE("a short series is not thinned") {
  const FigureSeries series = ramp(100);
  CHECK(holdfast::thinned(series, 100).y == series.y);
  CHECK(holdfast::thinned(series, 99).y.size() < 100);
}

TEST_CASE("thinning keeps extremes, gaps, order and the edges of a band") {
  FigureSeries series = ramp(100'000);
  series.y[12'345] = 7.0;
  series.y[54'321] = -8.0;
  series.y[77'777] = kNan;
  for (const double y : series.y) {
    series.low.push_back(y - 1.0);
    series.high.push_back(y + 1.0);
  }
  series.low[33'333] = -20.0;
  const FigureSeries thin = holdfast::thinned(series, 1000);
  CHECK(thin.x.size() <= 1000);
  CHECK(thin.x.size() > 300);
  CHECK(thin.y.size() == thin.x.size());
  CHECK(thin.low.size() == thin.x.size());
  CHECK(std::is_sorted(thin.x.begin(), thin.x.end()));
  const auto spike = std::find(thin.y.begin(), thin.y.end(), 7.0);
  REQUIRE(spike != thin.y.end());
  CHECK(thin.x[static_cast<std::size_t>(spike - thin.y.begin())] == 12'345.0);
  CHECK(std::count(thin.y.begin(), thin.y.end(), -8.0) == 1);
  CHECK(std::count_if(thin.y.begin(), thin.y.end(), [](double y) { return std::isnan(y); }) == 1);
  CHECK(*std::min_element(thin.low.begin(), thin.low.end()) == -20.0);
}

TEST_CASE("arrays of unequal length are cut, a band that does not fit is left out") {
  FigureSeries series{"odd", {1, 2, 3}, {1, 2}, {0, 0, 0}, {2, 2, 2}};
  const FigureSeries equal = holdfast::with_equal_lengths(series);
  CHECK(equal.x == std::vector<double>{1, 2});
  CHECK(equal.y == std::vector<double>{1, 2});
  CHECK(equal.low.empty());
  CHECK(equal.high.empty());
}

TEST_CASE("a figure has data when a point of it is finite") {
  const double infinity = std::numeric_limits<double>::infinity();
  Figure figure;
  CHECK_FALSE(holdfast::has_data(figure));
  figure.series = {{"a", {0, 1, kNan}, {kNan, infinity, 3}}};
  CHECK_FALSE(holdfast::has_data(figure));
  figure.series.push_back({"b", {0}, {1}});
  CHECK(holdfast::has_data(figure));
  figure.series = {{"band only", {0}, {kNan}, {-1}, {1}}};
  CHECK(holdfast::has_data(figure));
}

TEST_CASE("names of files stay in their folder and differ") {
  std::vector<Figure> figures(6);
  figures[0].name = "state_1";
  figures[1].name = "state_1";
  figures[2].name = "../../etc/passwd";
  figures[3].name = "";
  figures[4].name = "A'; rm -rf `x`\n";
  figures[5].name = std::string(500, 'a');
  const std::vector<std::string> names = holdfast::file_names(figures);
  CHECK(names[0] == "state_1");
  CHECK(names[1] == "state_1_2");
  CHECK(names[2] == "______etc_passwd");
  CHECK(names[3] == "figure");
  CHECK(names[4] == "a___rm__rf__x__");
  CHECK(names[5].size() < 100);
}
