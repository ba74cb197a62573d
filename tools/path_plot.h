#pragma once

#include <string>
#include <vector>

namespace holdfast {

struct PlotPoint {
  double x = 0.0, y = 0.0;
};

struct PlotPath {
  std::string name;
  std::vector<PlotPoint> points;  // in step order; points that are not finite break the line
};

/// A path in the plane: the truth, what each estimator says, and the sensors.
struct PathPlot {
  std::string title;
  std::string x_label, y_label;  // with units
  std::vector<PlotPoint> truth;
  std::vector<PlotPath> estimates;
  std::vector<PlotPoint> sensors;
};

/// Draws the plot as one self-contained SVG, 720 wide, with equal scales on both axes.
///
/// The frame follows the truth and the sensors, and near estimates: one that runs away is cut at
/// the frame and the legend says so. Same plot, same bytes. Colours and dashes tell paths apart
/// without colour vision, on light and dark pages. Text is escaped. Long paths are thinned to 2000
/// points.
std::string draw_path_plot(const PathPlot& plot);

}  // namespace holdfast
