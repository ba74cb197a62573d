#include "tools/report/gnuplot_script.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>

#include "tools/printable_text.h"
#include "tools/report/figure_data.h"

namespace holdfast {
namespace {

constexpr std::size_t kPlotPointsMax = 4000;
constexpr std::size_t kSpansMax = 200;
constexpr std::size_t kPlotTextBytesMax = 120;

// Okabe and Ito's palette, darkest first; with dashes and marks for prints in grey.
constexpr std::array<const char*, 7> kColours = {"#000000", "#0072b2", "#d55e00", "#009e73",
                                                 "#cc79a7", "#e69f00", "#56b4e9"};
constexpr std::array<const char*, 6> kSolidDashes = {"solid",          "(24,4)", "(24,4,3,4)",
                                                     "(24,4,3,4,3,4)", "(12,3)", "(36,6)"};
constexpr std::array<const char*, 6> kOpenDashes = {"(7,5)", "(2,4)",  "(10,4,2,4)",
                                                    "(4,4)", "(14,7)", "(1,3)"};
constexpr std::array<int, 6> kMarks = {7, 5, 9, 13, 11, 1};

std::string number(double value) {
  if (!std::isfinite(value)) return "NaN";
  char buffer[64];
  const auto end =
      std::to_chars(buffer, buffer + sizeof buffer, value, std::chars_format::general, 9);
  return {buffer, end.ptr};
}

struct Range {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  void add(double value) {
    // gnuplot refuses axes beyond this.
    if (!(std::fabs(value) < 1e300)) return;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  bool is_empty() const { return !(low <= high); }
};

std::string range_text(const Range& range, double margin_share) {
  const double span = range.high - range.low;
  const double margin =
      span > 0.0 ? margin_share * span : std::max(1e-9, 0.5 * std::fabs(range.low));
  return "[" + number(range.low - margin) + ":" + number(range.high + margin) + "]";
}

Range x_span(const std::vector<FigureSeries>& series) {
  Range range;
  for (const FigureSeries& one : series) {
    for (std::size_t i = 0; i < one.x.size(); ++i) {
      const bool has_band = !one.low.empty() && std::isfinite(one.low[i]);
      if (std::isfinite(one.y[i]) || has_band) range.add(one.x[i]);
    }
  }
  return range;
}

// What y spans; of the logarithms of positive values where the axis is logarithmic.
Range y_span(const std::vector<FigureSeries>& series, const Figure& figure) {
  Range range;
  const auto add = [&](double value) {
    if (!figure.has_log_y || value > 0.0) range.add(figure.has_log_y ? std::log10(value) : value);
  };
  for (const FigureSeries& one : series) {
    for (const auto* values : {&one.y, &one.low, &one.high}) {
      std::for_each(values->begin(), values->end(), add);
    }
  }
  for (const FigureLevel& level : figure.levels) add(level.y);
  return range.is_empty() ? Range{-1.0, 0.0} : range;
}

std::string y_range_text(const Range& span, bool is_log) {
  if (!is_log) return range_text(span, 0.05);
  const double margin = span.high > span.low ? 0.05 * (span.high - span.low) : 0.5;
  return "[" + number(std::pow(10.0, span.low - margin)) + ":" +
         number(std::pow(10.0, span.high + margin)) + "]";
}

// Height of an SVG picture: a legend below and, for a map, the shape of what it shows.
int height_of(const Figure& figure, double y_per_x) {
  std::size_t num_entries = figure.series.size() + figure.levels.size();
  std::vector<std::string> names;
  for (const FigureSpan& span : figure.spans) {
    if (std::find(names.begin(), names.end(), span.name) == names.end()) names.push_back(span.name);
  }
  num_entries += names.size();
  const double legend = 20.0 * static_cast<double>(std::min<std::size_t>(num_entries, 20));
  const double plot = figure.has_equal_axes ? std::clamp(470.0 * y_per_x, 150.0, 600.0) : 270.0;
  return static_cast<int>(plot + 110.0 + 0.8 * legend);
}

std::string settings(const Figure& figure, const std::string& name, const std::string& format,
                     double y_per_x) {
  std::string text = "# Draws " + name + "." + format + ": gnuplot " + name + ".gp\nreset\n";
  // A column of a paper is 89 mm wide: letters are 8 points high there.
  const int height = height_of(figure, y_per_x);
  text += format == "png"
              ? "set terminal pngcairo size 1400," + std::to_string(height * 5 / 2) +
                    " noenhanced font 'sans,24' linewidth 2.4 dashlength 1 background '#ffffff'\n"
              : "set terminal svg size 560," + std::to_string(height) +
                    " noenhanced font 'sans-serif,13' linewidth 1.2 dashlength 1 background "
                    "'#ffffff'\n";
  // What is one size to cairo is a larger one to the SVG terminal.
  text += format == "png" ? "mark = 1\n" : "mark = 0.6\n";
  text += "set encoding utf8\nset output '" + name + "." + format + "'\n";
  text += "set title " + gnuplot_text(figure.title) + " noenhanced\n";
  text += "set xlabel " + gnuplot_text(figure.x_label) + " noenhanced\n";
  text += "set ylabel " + gnuplot_text(figure.y_label) + " noenhanced\n";
  text +=
      "set key below center horizontal Left reverse noenhanced samplen 3 width 1 height 1\n"
      "set grid linecolor rgb '#dddddd' linetype 1 linewidth 0.6\nset tics nomirror out\n"
      "set border 3\n";
  if (figure.has_log_y) text += "set logscale y\nset format y '%h'\n";
  if (figure.has_equal_axes) text += "set size ratio -1\n";
  return text;
}

std::string data_block(const FigureSeries& series, std::size_t index) {
  std::string text = "$data" + std::to_string(index) + " << END\n";
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    text += number(series.x[i]) + " " + number(series.y[i]);
    if (!series.low.empty()) text += " " + number(series.low[i]) + " " + number(series.high[i]);
    text += "\n";
  }
  return text + "END\n";
}

// Spans of one name that the picture would not tell apart, as one.
std::vector<FigureSpan> merged(std::vector<FigureSpan> spans, const Range& x) {
  std::erase_if(spans, [&](const FigureSpan& span) {
    return !std::isfinite(span.from) || !std::isfinite(span.to) || span.to < x.low ||
           span.from > x.high;
  });
  if (spans.size() <= kSpansMax) return spans;
  std::stable_sort(spans.begin(), spans.end(),
                   [](const FigureSpan& a, const FigureSpan& b) { return a.from < b.from; });
  std::map<std::string, std::size_t> last;
  std::vector<FigureSpan> result;
  for (const FigureSpan& span : spans) {
    const auto place = last.find(span.name);
    if (place != last.end() &&
        span.from - result[place->second].to <= (x.high - x.low) / kSpansMax) {
      result[place->second].to = std::max(result[place->second].to, span.to);
    } else {
      last[span.name] = result.size();
      result.push_back(span);
    }
  }
  return result;
}

// Light, so that curves stand out; the first name is a plain grey, others are hatched.
std::string span_style(std::size_t place) {
  constexpr std::array<const char*, 5> kStyles = {
      "fillcolor rgb '#dcdcdc' fillstyle solid 1 noborder",
      "fillcolor rgb '#b0b0b0' fillstyle pattern 4 noborder",
      "fillcolor rgb '#b0b0b0' fillstyle pattern 5 noborder",
      "fillcolor rgb '#b0b0b0' fillstyle pattern 2 noborder",
      "fillcolor rgb '#efefef' fillstyle solid 1 noborder"};
  return kStyles[place % kStyles.size()];
}

std::string spans_text(const Figure& figure, const Range& x, std::vector<std::string>& plots) {
  std::string text;
  std::vector<std::string> names;
  for (const FigureSpan& span : merged(figure.spans, x)) {
    const auto found = std::find(names.begin(), names.end(), span.name);
    const auto place = static_cast<std::size_t>(found - names.begin());
    if (found == names.end()) {
      names.push_back(span.name);
      plots.push_back("keyentry with boxes " + span_style(place) + " title " +
                      gnuplot_text(span.name));
    }
    const double from = std::max(span.from, x.low), to = std::min(span.to, x.high);
    text += "set object rectangle from first " + number(from) + ", graph 0 to first " + number(to) +
            ", graph 1 behind " + span_style(place) + "\n";
  }
  return text;
}

std::string curve(const FigureSeries& series, std::size_t index) {
  const std::string colour = kColours[index % kColours.size()];
  const auto& dashes = series.is_dashed ? kOpenDashes : kSolidDashes;
  const std::string title = " title " + gnuplot_text(series.name);
  const std::string data = "$data" + std::to_string(index) + " using 1:2 with ";
  if (series.style == FigureSeries::Style::kPoints) {
    return data + "points pointtype " + std::to_string(kMarks[index % kMarks.size()]) +
           " pointsize mark * " + (series.x.size() > 300 ? "0.4" : "0.7") + " linecolor rgb '" +
           colour + "'" + title;
  }
  const std::string kind = series.style == FigureSeries::Style::kSteps ? "steps" : "lines";
  // Dashes of a curve that fills every pixel are only noise.
  const std::string dash = series.x.size() > 1500 ? "solid" : dashes[index % dashes.size()];
  return data + kind + " linewidth 1.4 dashtype " + dash + " linecolor rgb '" + colour + "'" +
         title;
}

}  // namespace

std::string gnuplot_text(const std::string& text) {
  std::string quoted = "'";
  for (const char c : printable(text, kPlotTextBytesMax)) {
    // A doubled quote is not enough: gnuplot 5.4 takes one at the beginning for an empty string.
    if (c == '\'' || c == '`') {
      quoted += "\u2019";
    } else {
      quoted += c;
    }
  }
  return quoted + "'";
}

std::string gnuplot_script(const Figure& figure, const std::string& name,
                           const std::string& format) {
  if (!has_data(figure)) {
    return settings(figure, name, format, 0.5) +
           "set label 1 'no data' at graph 0.5, graph 0.5 center\nset xrange [0:1]\nset yrange "
           "[0.1:1]\nunset tics\nplot 0 notitle with lines linecolor rgb '#ffffff'\n";
  }
  std::vector<FigureSeries> series;
  for (const FigureSeries& raw : figure.series) series.push_back(thinned(raw, kPlotPointsMax));
  const Range x = x_span(series), y = y_span(series, figure);
  std::string text =
      settings(figure, name, format, x.high > x.low ? (y.high - y.low) / (x.high - x.low) : 1.0);
  text += "set xrange " + range_text(x, 0.01) + "\nset yrange " +
          y_range_text(y, figure.has_log_y) + "\n";
  std::vector<std::string> curves, levels, spans;
  std::string bands;
  text += spans_text(figure, x, spans);
  for (std::size_t i = 0; i < series.size(); ++i) {
    text += data_block(series[i], i);
    if (!series[i].low.empty()) {
      bands += "$data" + std::to_string(i) +
               " using 1:3:4 with filledcurves fillstyle transparent solid 0.2 noborder fillcolor "
               "rgb '" +
               kColours[i % kColours.size()] + "' notitle, \\\n  ";
    }
    curves.push_back(curve(series[i], i));
  }
  for (std::size_t i = 0; i < figure.levels.size(); ++i) {
    if (!std::isfinite(figure.levels[i].y)) continue;
    levels.push_back(number(figure.levels[i].y) + " with lines linewidth 1 dashtype " +
                     (i % 2 == 0 ? "(8,4)" : "(8,4,2,4)") + " linecolor rgb '#444444' title " +
                     gnuplot_text(figure.levels[i].name));
  }
  text += "plot " + bands;
  curves.insert(curves.end(), levels.begin(), levels.end());
  curves.insert(curves.end(), spans.begin(), spans.end());
  for (std::size_t i = 0; i < curves.size(); ++i) text += (i > 0 ? ", \\\n  " : "") + curves[i];
  return text + "\n";
}

}  // namespace holdfast
