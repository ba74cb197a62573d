#pragma once

#include <string>
#include <vector>

namespace holdfast {

/// Rows of cells under a header, aligned for a terminal: the first num_left columns to the left,
/// the others to the right. Widths count characters, not bytes; cells must be printable.
class TextTable {
 public:
  explicit TextTable(std::size_t num_left = 1) : num_left_(num_left) {}

  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  bool is_empty() const { return rows_.size() < 2; }
  std::string text() const;

 private:
  std::size_t num_left_;
  std::vector<std::vector<std::string>> rows_;
};

/// Up to `digits` significant digits; "-" for a number that is not finite.
std::string number_text(double value, int digits = 4);
/// "value ± standard error"; the value alone when the error is not finite.
std::string number_with_error(double value, double standard_error);

}  // namespace holdfast
