#pragma once

#include <vector>

#include "tools/review_figure_parts.h"

namespace holdfast {

/// Marks of touched and foreign frames, and packets per step.
std::vector<Figure> frame_figures(const FigureContext& context);
/// Loss counters of each process that lost something.
std::vector<Figure> loss_figures(const FigureContext& context);
/// Time of each step, and its distribution.
std::vector<Figure> time_figures(const FigureContext& context);
/// Truth, estimates and sensors in the plane.
std::vector<Figure> path_figures(const FigureContext& context);

}  // namespace holdfast
