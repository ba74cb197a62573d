#pragma once

#include <string>
#include <vector>

#include "tools/report/figure.h"

namespace holdfast {

/// The page with charts that zoom; needs the plotting library in the build.
std::string interactive_page(const Report& report);

/// The page with pictures: one SVG text a figure, as gnuplot writes it.
std::string static_page(const Report& report, const std::vector<std::string>& svg_pictures);

}  // namespace holdfast
