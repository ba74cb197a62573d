#pragma once

#include <string>

#include "tools/report/figure.h"

namespace holdfast {

/// The gnuplot script that draws the figure into NAME.svg or NAME.png (format "svg" or "png"), its
/// data inside. Text stands in single quotes only, without what gnuplot would run or replace.
/// Curves of more than 4000 points are thinned() to these.
std::string gnuplot_script(const Figure& figure, const std::string& name,
                           const std::string& format);

/// The text as a string of a gnuplot script: printable, in single quotes, and without any quotes of
/// its own (typographic ones stand for them).
std::string gnuplot_text(const std::string& text);

}  // namespace holdfast
