#include "tools/path_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

#include "tools/printable_text.h"

namespace holdfast {
namespace {

constexpr double kWidth = 720.0, kLeft = 64.0, kRight = 16.0, kTop = 40.0, kAxisHeight = 52.0;
constexpr double kPlotHeightMin = 260.0, kPlotHeightMax = 640.0;
constexpr double kLegendRow = 20.0, kLegendColumn = 213.0;
constexpr int kLegendColumns = 3;
constexpr std::size_t kPointsMax = 2000;
// How far estimates may widen the frame beyond truth and sensors, in spans of these.
constexpr double kEstimateReach = 0.3;
// Grey with the same contrast, 4.6 : 1, to white and to black.
constexpr const char* kGrey = "#757575";

// Colours of Okabe and Ito's palette that are seen on white and on black, each with its own dashes.
struct Stroke {
  const char* colour;
  const char* dashes;
};
constexpr std::array<Stroke, 6> kStrokes = {{{"#0072b2", "none"},
                                             {"#d55e00", "7 3"},
                                             {"#009e73", "2 3"},
                                             {"#cc79a7", "9 3 2 3"},
                                             {"#e69f00", "4 4"},
                                             {"#56b4e9", "12 4"}}};

std::string number(double value, int decimals = 2) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  std::string shown = text;
  return shown == "-0.00" || shown == "-0.0" || shown == "-0" ? shown.substr(1) : shown;
}

bool is_finite(const PlotPoint& point) {
  return std::isfinite(point.x) && std::isfinite(point.y);
}

struct Box {
  double x_low = std::numeric_limits<double>::infinity(), x_high = -x_low;
  double y_low = x_low, y_high = -x_low;

  bool is_empty() const { return !(x_low <= x_high); }
  void add(const std::vector<PlotPoint>& points) {
    for (const PlotPoint& p : points) {
      // Beyond this a path would leave a scale that a reader can use, and differences overflow.
      if (!is_finite(p) || std::max(std::fabs(p.x), std::fabs(p.y)) > 1e12) continue;
      x_low = std::min(x_low, p.x);
      x_high = std::max(x_high, p.x);
      y_low = std::min(y_low, p.y);
      y_high = std::max(y_high, p.y);
    }
  }
  bool holds(const PlotPoint& p) const {
    return p.x >= x_low && p.x <= x_high && p.y >= y_low && p.y <= y_high;
  }
};

// The part of the plane that is shown: truth and sensors, and estimates as far as they keep near.
Box framed(const PathPlot& plot) {
  Box box;
  box.add(plot.truth);
  box.add(plot.sensors);
  Box estimates;
  for (const PlotPath& path : plot.estimates) estimates.add(path.points);
  if (box.is_empty()) box = estimates;
  if (box.is_empty()) return {0.0, 1.0, 0.0, 1.0};
  const double largest = std::max(
      {std::fabs(box.x_low), std::fabs(box.x_high), std::fabs(box.y_low), std::fabs(box.y_high)});
  // A path that stands still gets a frame too, wide enough for the numbers at its ticks.
  const double span =
      std::max({box.x_high - box.x_low, box.y_high - box.y_low, 1e-6 * largest, 1e-6});
  const double reach = kEstimateReach * span;
  const double margin = 0.08 * span;
  return {std::max(std::min(box.x_low, estimates.x_low), box.x_low - reach) - margin,
          std::min(std::max(box.x_high, estimates.x_high), box.x_high + reach) + margin,
          std::max(std::min(box.y_low, estimates.y_low), box.y_low - reach) - margin,
          std::min(std::max(box.y_high, estimates.y_high), box.y_high + reach) + margin};
}

// Maps the plane to the picture, with one scale for both axes.
class Frame {
 public:
  explicit Frame(Box box) {
    const double width = kWidth - kLeft - kRight;
    const double wanted = width * (box.y_high - box.y_low) / (box.x_high - box.x_low);
    height_ = std::clamp(wanted, kPlotHeightMin, kPlotHeightMax);
    scale_ = std::min(width / (box.x_high - box.x_low), height_ / (box.y_high - box.y_low));
    const double x_slack = 0.5 * (width / scale_ - (box.x_high - box.x_low));
    const double y_slack = 0.5 * (height_ / scale_ - (box.y_high - box.y_low));
    box_ = {box.x_low - x_slack, box.x_high + x_slack, box.y_low - y_slack, box.y_high + y_slack};
  }

  const Box& box() const { return box_; }
  double bottom() const { return kTop + height_; }
  double height() const { return height_; }
  // Far outside all places look the same; the bound keeps the numbers in the file short.
  double x(double value) const {
    return std::clamp(kLeft + (value - box_.x_low) * scale_, -1e5, 1e5);
  }
  double y(double value) const {
    return std::clamp(bottom() - (value - box_.y_low) * scale_, -1e5, 1e5);
  }

 private:
  Box box_;
  double height_ = 0.0, scale_ = 1.0;
};

// Distance of ticks: 1, 2 or 5 times a power of ten, so that about count fit.
double tick_step(double low, double high, int count) {
  const double raw = (high - low) / count;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  const double factor = raw / power;
  return power * (factor <= 1.0 ? 1.0 : factor <= 2.0 ? 2.0 : factor <= 5.0 ? 5.0 : 10.0);
}

std::string axes(const Frame& frame, const PathPlot& plot) {
  const Box& box = frame.box();
  const double step = tick_step(box.x_low, box.x_high, 8);
  const int decimals = std::clamp(static_cast<int>(-std::floor(std::log10(step) + 1e-9)), 0, 9);
  std::string grid, labels;
  const auto line = [&grid](double x1, double y1, double x2, double y2) {
    grid += "<path d=\"M" + number(x1) + " " + number(y1) + "L" + number(x2) + " " + number(y2) +
            "\"/>\n";
  };
  for (double i = std::ceil(box.x_low / step); i * step <= box.x_high; ++i) {
    const double x = frame.x(i * step);
    line(x, kTop, x, frame.bottom());
    labels += "<text x=\"" + number(x) + "\" y=\"" + number(frame.bottom() + 16) +
              "\" text-anchor=\"middle\">" + number(i * step, decimals) + "</text>\n";
  }
  for (double i = std::ceil(box.y_low / step); i * step <= box.y_high; ++i) {
    const double y = frame.y(i * step);
    line(kLeft, y, kWidth - kRight, y);
    labels += "<text x=\"" + number(kLeft - 6) + "\" y=\"" + number(y + 4) +
              "\" text-anchor=\"end\">" + number(i * step, decimals) + "</text>\n";
  }
  const double x_middle = 0.5 * (kLeft + kWidth - kRight), y_middle = kTop + 0.5 * frame.height();
  labels += "<text x=\"" + number(x_middle) + "\" y=\"" + number(frame.bottom() + 36) +
            "\" text-anchor=\"middle\">" + printable_xml(plot.x_label, 80) + "</text>\n";
  labels += "<text x=\"14\" y=\"" + number(y_middle) +
            "\" text-anchor=\"middle\" transform=\"rotate(-90 14 " + number(y_middle) + ")\">" +
            printable_xml(plot.y_label, 80) + "</text>\n";
  return std::string("<g stroke=\"") + kGrey + "\" stroke-opacity=\"0.3\" fill=\"none\">\n" + grid +
         "<rect x=\"" + number(kLeft) + "\" y=\"" + number(kTop) + "\" width=\"" +
         number(kWidth - kLeft - kRight) + "\" height=\"" + number(frame.height()) +
         "\" stroke-opacity=\"1\"/>\n</g>\n<g fill=\"" + kGrey + "\">\n" + labels + "</g>\n";
}

std::string path_data(const std::vector<PlotPoint>& points, const Frame& frame) {
  std::string data;
  bool is_drawing = false;
  const std::size_t stride = points.size() / kPointsMax + 1;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (i % stride != 0 && i + 1 != points.size()) continue;
    if (!is_finite(points[i])) {
      is_drawing = false;
      continue;
    }
    data += (is_drawing ? "L" : "M") + number(frame.x(points[i].x)) + " " +
            number(frame.y(points[i].y));
    is_drawing = true;
  }
  return data;
}

std::string drawn(const std::string& data, const std::string& colour, const std::string& width,
                  const std::string& dashes) {
  return "<path d=\"" + data + "\" fill=\"none\" stroke=\"" + colour + "\" stroke-width=\"" +
         width + "\" stroke-dasharray=\"" + dashes + "\" stroke-linejoin=\"round\"/>\n";
}

std::string sensor_mark(double x, double y) {
  return "<path d=\"M" + number(x - 4) + " " + number(y + 3.5) +
         "h8l-4 -7z\" fill=\"none\" stroke=\"" + kGrey + "\"/>\n";
}

std::string start_mark(double x, double y) {
  return "<circle cx=\"" + number(x) + "\" cy=\"" + number(y) + "\" r=\"5\" fill=\"" + kGrey +
         "\"/>\n";
}

class Legend {
 public:
  explicit Legend(double top) : top_(top) {}

  // Place of the next entry's mark: left end and middle height.
  PlotPoint place() const {
    const int row = count_ / kLegendColumns;
    return {kLeft + kLegendColumn * (count_ % kLegendColumns), top_ + kLegendRow * row};
  }
  void add(const std::string& mark, const std::string& text) {
    entries_ += mark + "<text x=\"" + number(place().x + 34) + "\" y=\"" + number(place().y + 4) +
                "\" fill=\"" + kGrey + "\">" + printable_xml(text, 60) + "</text>\n";
    ++count_;
  }
  void add_line(const std::string& text, const std::string& colour, const std::string& width,
                const std::string& dashes) {
    const std::string line = "M" + number(place().x) + " " + number(place().y) + "h28";
    add(drawn(line, colour, width, dashes), text);
  }
  const std::string& entries() const { return entries_; }
  double height() const {
    const int num_rows = (count_ + kLegendColumns - 1) / kLegendColumns;
    return kLegendRow * num_rows;
  }

 private:
  double top_;
  int count_ = 0;
  std::string entries_;
};

}  // namespace

std::string draw_path_plot(const PathPlot& plot) {
  const Frame frame(framed(plot));
  Legend legend(frame.bottom() + kAxisHeight + 4);
  std::string curves;
  for (const PlotPoint& sensor : plot.sensors) {
    if (is_finite(sensor)) curves += sensor_mark(frame.x(sensor.x), frame.y(sensor.y));
  }
  if (!plot.truth.empty()) {
    curves += drawn(path_data(plot.truth, frame), kGrey, "5", "none");
    legend.add_line("truth", kGrey, "5", "none");
  }
  for (std::size_t e = 0; e < plot.estimates.size(); ++e) {
    const PlotPath& path = plot.estimates[e];
    const Stroke& stroke = kStrokes[e % kStrokes.size()];
    curves += drawn(path_data(path.points, frame), stroke.colour, "2", stroke.dashes);
    const bool leaves =
        std::any_of(path.points.begin(), path.points.end(),
                    [&](const PlotPoint& p) { return is_finite(p) && !frame.box().holds(p); });
    legend.add_line(path.name + (leaves ? " (leaves the picture)" : ""), stroke.colour, "2",
                    stroke.dashes);
  }
  const auto start = std::find_if(plot.truth.begin(), plot.truth.end(), is_finite);
  if (start != plot.truth.end()) {
    curves += start_mark(frame.x(start->x), frame.y(start->y));
    legend.add(start_mark(legend.place().x + 14, legend.place().y), "start");
  }
  if (!plot.sensors.empty())
    legend.add(sensor_mark(legend.place().x + 14, legend.place().y), "sensor");

  const double height = frame.bottom() + kAxisHeight + legend.height() + 4;
  const std::string title = printable_xml(plot.title, 100);
  return "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"720\" height=\"" + number(height, 0) +
         "\" viewBox=\"0 0 720 " + number(height, 0) +
         "\" font-family=\"sans-serif\" font-size=\"12\" role=\"img\">\n<title>" + title +
         "</title>\n<defs><clipPath id=\"frame\"><rect x=\"" + number(kLeft) + "\" y=\"" +
         number(kTop) + "\" width=\"" + number(kWidth - kLeft - kRight) + "\" height=\"" +
         number(frame.height()) + "\"/></clipPath></defs>\n<text x=\"" + number(kLeft) +
         "\" y=\"24\" font-size=\"15\" fill=\"" + kGrey + "\">" + title + "</text>\n" +
         axes(frame, plot) + "<g clip-path=\"url(#frame)\">\n" + curves + "</g>\n" +
         legend.entries() + "</svg>\n";
}

}  // namespace holdfast
