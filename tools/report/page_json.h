#pragma once

#include <cstddef>
#include <string>

#include "tools/report/figure.h"

namespace holdfast {

/// Longer texts are cut in a page.
inline constexpr std::size_t kPageTextBytesMax = 1000;

/// The figures of a report as the page's script reads them: JSON in ASCII that may stand inside an
/// HTML element, since it holds no '<'.
///
/// {"x": [X], "figures": [{name, title, x_label, y_label, log_y, equal, series, levels, spans}]};
/// a series names its X by index. X is an array or {start, step, count}; null stands for what is no
/// finite number. Values are rounded to about six digits of their range. A series of more than
/// 200 000 points is thinned() to these.
std::string page_json(const std::vector<Figure>& figures);

}  // namespace holdfast
