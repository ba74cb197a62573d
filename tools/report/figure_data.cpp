#include "tools/report/figure_data.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>

namespace holdfast {
namespace {

constexpr std::size_t kNameBytesMax = 80;

// Indices of one run of neighbours that stand for it, in order.
std::set<std::size_t> extremes(const std::vector<double>& y, std::size_t from, std::size_t to) {
  std::optional<std::size_t> lowest, highest, gap;
  for (std::size_t i = from; i < to; ++i) {
    if (!std::isfinite(y[i])) {
      if (!gap) gap = i;
      continue;
    }
    if (!lowest || y[i] < y[*lowest]) lowest = i;
    if (!highest || y[i] > y[*highest]) highest = i;
  }
  std::set<std::size_t> kept;
  for (const auto& index : {lowest, highest, gap}) {
    if (index) kept.insert(*index);
  }
  return kept;
}

double smallest(const std::vector<double>& values, std::size_t from, std::size_t to) {
  double result = std::numeric_limits<double>::quiet_NaN();
  for (std::size_t i = from; i < to; ++i) result = std::fmin(result, values[i]);
  return result;
}

double largest(const std::vector<double>& values, std::size_t from, std::size_t to) {
  double result = std::numeric_limits<double>::quiet_NaN();
  for (std::size_t i = from; i < to; ++i) result = std::fmax(result, values[i]);
  return result;
}

}  // namespace

FigureSeries with_equal_lengths(const FigureSeries& series) {
  FigureSeries result = series;
  const std::size_t size = std::min(series.x.size(), series.y.size());
  result.x.resize(size);
  result.y.resize(size);
  if (series.low.size() != size || series.high.size() != size) {
    result.low.clear();
    result.high.clear();
  }
  return result;
}

FigureSeries thinned(const FigureSeries& series, std::size_t max_points) {
  FigureSeries equal = with_equal_lengths(series);
  const std::size_t size = equal.x.size();
  if (size <= max_points) return equal;
  // A run is kept as up to three points.
  const std::size_t run = (3 * size + max_points - 1) / std::max<std::size_t>(1, max_points);
  FigureSeries result = equal;
  result.x.clear();
  result.y.clear();
  result.low.clear();
  result.high.clear();
  for (std::size_t from = 0; from < size; from += run) {
    const std::size_t to = std::min(size, from + run);
    for (const std::size_t i : extremes(equal.y, from, to)) {
      result.x.push_back(equal.x[i]);
      result.y.push_back(equal.y[i]);
      if (equal.low.empty()) continue;
      result.low.push_back(smallest(equal.low, from, to));
      result.high.push_back(largest(equal.high, from, to));
    }
  }
  return result;
}

bool has_data(const Figure& figure) {
  return std::any_of(figure.series.begin(), figure.series.end(), [](const FigureSeries& raw) {
    const FigureSeries series = with_equal_lengths(raw);
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      const bool has_band = !series.low.empty() && std::isfinite(series.low[i]);
      if (std::isfinite(series.x[i]) && (std::isfinite(series.y[i]) || has_band)) return true;
    }
    return false;
  });
}

std::vector<std::string> file_names(const std::vector<Figure>& figures) {
  std::vector<std::string> names;
  for (const Figure& figure : figures) {
    std::string name;
    for (const char c : figure.name.substr(0, kNameBytesMax)) {
      const bool is_letter = c >= 'a' && c <= 'z';
      const bool is_capital = c >= 'A' && c <= 'Z';
      const bool is_digit = c >= '0' && c <= '9';
      name += is_letter || is_digit ? c : is_capital ? static_cast<char>(c - 'A' + 'a') : '_';
    }
    if (name.empty()) name = "figure";
    std::string unique = name;
    for (int i = 2; std::find(names.begin(), names.end(), unique) != names.end(); ++i) {
      unique = name + "_" + std::to_string(i);
    }
    names.push_back(unique);
  }
  return names;
}

}  // namespace holdfast
