#include "tools/text_table.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tools/printable_text.h"

namespace holdfast {

std::string TextTable::text() const {
  std::vector<std::size_t> widths;
  for (const auto& row : rows_) {
    widths.resize(std::max(widths.size(), row.size()), 0);
    for (std::size_t c = 0; c < row.size(); ++c)
      widths[c] = std::max(widths[c], text_width(row[c]));
  }
  std::string text;
  for (const auto& row : rows_) {
    std::string line;
    for (std::size_t c = 0; c < row.size(); ++c) {
      const std::string space(widths[c] - text_width(row[c]), ' ');
      if (c > 0) line += "  ";
      line += c < num_left_ ? row[c] + space : space + row[c];
    }
    text += line.substr(0, line.find_last_not_of(' ') + 1) + '\n';
  }
  return text;
}

std::string number_text(double value, int digits) {
  if (!std::isfinite(value)) return "-";
  char text[32];
  std::snprintf(text, sizeof text, "%.*g", digits, value);
  return text;
}

std::string number_with_error(double value, double standard_error) {
  if (!std::isfinite(standard_error)) return number_text(value);
  return number_text(value) + " ± " + number_text(standard_error, 2);
}

}  // namespace holdfast
