#include "tools/report/page_json.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "tools/printable_text.h"
#include "tools/report/figure_data.h"

namespace holdfast {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kPointsMax = 200'000;
constexpr int kDigits = 6, kDigitsOfOne = 9, kDigitsMax = 15;

Json text(const std::string& value) {
  return printable(value, kPageTextBytesMax);
}

// Significant digits that tell values apart that differ by the resolution.
int digits_for(double largest, double resolution) {
  if (!(largest > 0.0) || !std::isfinite(largest)) return kDigits;
  // All values are one.
  if (!(resolution > 0.0) || !std::isfinite(resolution)) return kDigitsOfOne;
  const double digits = std::ceil(std::log10(largest) - std::log10(resolution)) + 1.0;
  return static_cast<int>(std::clamp<double>(digits, kDigits, kDigitsMax));
}

// Rounded so that its shortest form has at most so many digits.
Json number(double value, int digits) {
  if (!std::isfinite(value)) return nullptr;
  char buffer[64];
  const auto end = std::to_chars(buffer, buffer + sizeof buffer, value,
                                 std::chars_format::scientific, digits - 1);
  double rounded = value;
  std::from_chars(buffer, end.ptr, rounded);
  // Whole numbers without ".0" make the page smaller.
  if (std::fabs(rounded) < 1e9 && rounded == std::floor(rounded)) {
    return static_cast<std::int64_t>(rounded);
  }
  return rounded;
}

Json numbers(const std::vector<double>& values, int digits) {
  Json result = Json::array();
  for (const double value : values) result.push_back(number(value, digits));
  return result;
}

Json values_of(const std::vector<double>& values, bool is_log) {
  double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    lowest = std::min(lowest, value);
    highest = std::max(highest, value);
  }
  const double largest = std::max(std::fabs(lowest), std::fabs(highest));
  // On a log axis what counts is the ratio to the value itself.
  return numbers(values, is_log ? kDigits : digits_for(largest, 1e-5 * (highest - lowest)));
}

Json axis_of(const std::vector<double>& x) {
  if (x.size() > 2 && std::isfinite(x.front()) && std::isfinite(x.back())) {
    const double step = (x.back() - x.front()) / static_cast<double>(x.size() - 1);
    bool is_even = step > 0.0;
    for (std::size_t i = 0; is_even && i < x.size(); ++i) {
      is_even = std::fabs(x[i] - (x.front() + static_cast<double>(i) * step)) <= 1e-6 * step;
    }
    if (is_even) return {{"start", x.front()}, {"step", step}, {"count", x.size()}};
  }
  double largest = 0.0, resolution = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (std::isfinite(x[i])) largest = std::max(largest, std::fabs(x[i]));
    if (i > 0 && x[i] > x[i - 1]) resolution = std::min(resolution, x[i] - x[i - 1]);
  }
  return numbers(x, digits_for(largest, 0.01 * resolution));
}

// Each array of x once, since most series of a run share theirs.
class Axes {
 public:
  std::size_t index_of(const std::vector<double>& x) {
    // NaN is unequal to itself and would be looked up in vain, so bytes are compared.
    const std::string key(reinterpret_cast<const char*>(x.data()), x.size() * sizeof(double));
    const auto [place, is_new] = indices_.try_emplace(key, indices_.size());
    if (is_new) axes_.push_back(axis_of(x));
    return place->second;
  }
  Json take() { return std::move(axes_); }

 private:
  std::map<std::string, std::size_t> indices_;
  Json axes_ = Json::array();
};

Json series_of(const FigureSeries& raw, bool is_log, Axes& axes) {
  const FigureSeries series = thinned(raw, kPointsMax);
  const char* const styles[] = {"line", "steps", "points"};
  Json result = {{"name", text(series.name)},
                 {"style", styles[static_cast<int>(series.style)]},
                 {"dashed", series.is_dashed},
                 {"x", axes.index_of(series.x)},
                 {"y", values_of(series.y, is_log)}};
  if (!series.low.empty()) {
    result["low"] = values_of(series.low, is_log);
    result["high"] = values_of(series.high, is_log);
  }
  return result;
}

Json figure_of(const Figure& figure, const std::string& name, Axes& axes) {
  Json result = {{"name", name},
                 {"title", text(figure.title)},
                 {"x_label", text(figure.x_label)},
                 {"y_label", text(figure.y_label)},
                 {"log_y", figure.has_log_y},
                 {"equal", figure.has_equal_axes},
                 {"series", Json::array()},
                 {"levels", Json::array()},
                 {"spans", Json::array()}};
  for (const FigureSeries& series : figure.series) {
    result["series"].push_back(series_of(series, figure.has_log_y, axes));
  }
  for (const FigureLevel& level : figure.levels) {
    if (!std::isfinite(level.y)) continue;
    result["levels"].push_back({{"name", text(level.name)}, {"y", number(level.y, kDigitsMax)}});
  }
  for (const FigureSpan& span : figure.spans) {
    if (!std::isfinite(span.from) || !std::isfinite(span.to)) continue;
    result["spans"].push_back({{"name", text(span.name)},
                               {"from", number(span.from, kDigitsMax)},
                               {"to", number(span.to, kDigitsMax)}});
  }
  return result;
}

}  // namespace

std::string page_json(const std::vector<Figure>& figures) {
  Axes axes;
  Json list = Json::array();
  const std::vector<std::string> names = file_names(figures);
  for (std::size_t i = 0; i < figures.size(); ++i) {
    list.push_back(figure_of(figures[i], names[i], axes));
  }
  const Json page = {{"x", axes.take()}, {"figures", std::move(list)}};
  std::string escaped;
  for (const char c : page.dump(-1, ' ', true, Json::error_handler_t::replace)) {
    if (c == '<') {
      escaped += "\\u003c";
    } else {
      escaped += c;
    }
  }
  return escaped;
}

}  // namespace holdfast
