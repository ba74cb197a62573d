#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "drivers/can/dbc.h"

namespace holdfast {

/// Words, numbers and quoted texts of a DBC file, with the place of every problem. Not for users.
///
/// Readers return false when what they want is not there; the problem is then noted already.
class DbcScanner {
 public:
  /// Takes any bytes; see parse_dbc() for encodings and line ends.
  explicit DbcScanner(const std::string& text);

  std::size_t position() const { return position_; }
  void move_to(std::size_t position) { position_ = position; }
  bool at_end() const { return position_ >= text_.size(); }
  /// The next character; at the end of the text a line end.
  char peek() const { return at_end() ? '\n' : text_[position_]; }
  void skip_blanks();
  /// Skips line ends too.
  void skip_space();
  /// Moves to the end of the line; true, as every reader that succeeds.
  bool skip_line();
  std::size_t line_end(std::size_t from) const {
    return std::min(text_.find('\n', from), text_.size());
  }
  /// True when the line that holds this position ends like this.
  bool line_ends_with(std::size_t from, std::string_view ending) const;

  /// Letters, digits and underscores from here on; maybe none.
  std::string_view keyword() const;
  bool accept(char wanted);
  bool expect(char wanted);
  bool read_word(std::string& word, const char* what);
  bool read_whole(std::int64_t& number, const char* what);
  bool read_number(double& number, const char* what);
  /// A text in quotes, line ends inside allowed; a backslash before a quote keeps it inside.
  bool read_quoted(std::string& text);

  /// Notes a problem; false.
  bool fail(std::size_t position, const std::string& text);
  bool fail(const std::string& text) { return fail(position_, text); }
  /// The problems in order of their places.
  std::vector<DbcProblem> problems() const;

 private:
  std::string text_;
  std::size_t position_ = 0;
  std::vector<std::pair<std::size_t, std::string>> problems_;
};

}  // namespace holdfast
