#pragma once

#include <string>
#include <vector>

namespace holdfast {

/// One curve or set of points of a figure. NaN breaks a line.
struct FigureSeries {
  enum class Style { kLine, kSteps, kPoints };

  std::string name;
  std::vector<double> x, y;
  std::vector<double> low = {}, high = {};  // band around the curve; empty for none
  Style style = Style::kLine;
  bool is_dashed = false;
};

/// A horizontal line, such as a threshold.
struct FigureLevel {
  double y = 0.0;
  std::string name;
};

/// A shaded interval of x, such as an attack.
struct FigureSpan {
  double from = 0.0, to = 0.0;
  std::string name;  // equal names share one entry in the legend
};

/// What a figure shows; how it is drawn is the renderers' matter. Text may come from a log: the
/// renderers escape it.
struct Figure {
  std::string name;                     // of its file: lower-case letters, digits, '_'
  std::string title, x_label, y_label;  // with units
  std::vector<FigureSeries> series = {};
  std::vector<FigureLevel> levels = {};
  std::vector<FigureSpan> spans = {};
  bool has_log_y = false;
  bool has_equal_axes = false;  // a map: one scale for x and y
  std::string note = {};        // one sentence below, e.g. what the band is
};

/// Rows of cells under a header.
struct ReportTable {
  std::string title;
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;
  std::string note = {};
};

/// Everything on one report page, in this order.
struct Report {
  std::string title, subtitle;
  std::vector<std::string> warnings = {};
  std::vector<ReportTable> tables = {};
  std::vector<Figure> figures = {};
};

}  // namespace holdfast
