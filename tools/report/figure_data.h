#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "tools/report/figure.h"

namespace holdfast {

/// The series with arrays of one length: as long as the shortest of x and y; a band of another
/// length than these is left out.
FigureSeries with_equal_lengths(const FigureSeries& series);

/// The series in at most about max_points points: of each run of neighbours the lowest and the
/// highest, and a NaN where the run had one; a band keeps the extremes of its edges. The same
/// series when it is short enough.
FigureSeries thinned(const FigureSeries& series, std::size_t max_points);

/// True when some point can be drawn: x and y (or an edge of the band) finite.
bool has_data(const Figure& figure);

/// Names for the files of figures: lower-case letters, digits and '_' only, none twice. Whatever a
/// figure is called, its file stays in its folder.
std::vector<std::string> file_names(const std::vector<Figure>& figures);

}  // namespace holdfast
