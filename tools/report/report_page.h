#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/report/figure.h"

namespace holdfast {

/// True when this build holds the plotting library, so that report pages are zoomable.
bool has_interactive_report();

/// The report as one self-contained HTML page that opens offline: charts that zoom where the build
/// has the plotting library, else static pictures (and the page says so).
///
/// Throws JobError when neither can be drawn (no plotting library in the build and no gnuplot).
std::string report_page(const Report& report);

/// Writes each figure as NAME.svg or NAME.png (format "svg" or "png"), with NAME.gp beside it, the
/// gnuplot script that drew it. The folder is made when missing. Throws JobError, naming the Debian
/// package, when gnuplot is missing.
void write_figures(const std::vector<Figure>& figures, const std::filesystem::path& folder,
                   const std::string& format);

}  // namespace holdfast
