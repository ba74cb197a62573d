#include "drivers/can/dbc_scanner.h"

#include <charconv>
#include <cmath>

namespace holdfast {
namespace {

bool is_blank(char c) {
  return c == ' ' || c == '\t' || c == '\v' || c == '\f';
}

bool is_keyword_character(char c) {
  return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_';
}

// Names may hold what the grammar forbids (dots, umlauts), but never what separates fields.
bool is_name_character(char c) {
  return static_cast<unsigned char>(c) > ' ' &&
         std::string_view(":;\",|@()[]").find(c) == std::string_view::npos;
}

bool continues_character(char c) {
  return (static_cast<unsigned char>(c) & 0xC0U) == 0x80U;
}

std::string with_plain_line_ends(std::string text) {
  std::size_t out = 0;
  for (std::size_t in = 0; in < text.size(); ++in) {
    if (text[in] == '\r' && in + 1 < text.size() && text[in + 1] == '\n') continue;
    text[out++] = text[in] == '\r' ? '\n' : text[in];
  }
  text.resize(out);
  return text;
}

}  // namespace

DbcScanner::DbcScanner(const std::string& text) : text_(with_plain_line_ends(utf8_text(text))) {}

void DbcScanner::skip_blanks() {
  while (!at_end() && is_blank(text_[position_])) ++position_;
}

void DbcScanner::skip_space() {
  while (!at_end() && (is_blank(text_[position_]) || text_[position_] == '\n')) ++position_;
}

bool DbcScanner::skip_line() {
  position_ = line_end(position_);
  return true;
}

bool DbcScanner::line_ends_with(std::size_t from, std::string_view ending) const {
  std::size_t end = line_end(from);
  while (end > from && is_blank(text_[end - 1])) --end;
  return end >= from + ending.size() &&
         std::string_view(text_).substr(end - ending.size(), ending.size()) == ending;
}

std::string_view DbcScanner::keyword() const {
  std::size_t end = position_;
  while (end < text_.size() && is_keyword_character(text_[end])) ++end;
  return std::string_view(text_).substr(std::min(position_, text_.size()), end - position_);
}

bool DbcScanner::accept(char wanted) {
  skip_blanks();
  if (at_end() || text_[position_] != wanted) return false;
  ++position_;
  return true;
}

bool DbcScanner::expect(char wanted) {
  return accept(wanted) || fail(std::string("'") + wanted + "' expected");
}

bool DbcScanner::read_word(std::string& word, const char* what) {
  skip_blanks();
  const std::size_t start = position_;
  while (!at_end() && is_name_character(text_[position_])) ++position_;
  word = text_.substr(start, position_ - start);
  return !word.empty() || fail(std::string(what) + " expected");
}

bool DbcScanner::read_whole(std::int64_t& number, const char* what) {
  skip_blanks();
  const std::size_t start = position_;
  if (!at_end() && text_[position_] == '+') ++position_;
  const char* first = text_.data() + position_;
  const auto [stop, error] = std::from_chars(first, text_.data() + text_.size(), number);
  if (error == std::errc::result_out_of_range)
    return fail(start, std::string(what) + " is out of range");
  if (error != std::errc{}) return fail(start, std::string(what) + " expected");
  position_ += static_cast<std::size_t>(stop - first);
  return true;
}

bool DbcScanner::read_number(double& number, const char* what) {
  skip_blanks();
  const std::size_t start = position_;
  if (!at_end() && text_[position_] == '+') ++position_;
  const char* first = text_.data() + position_;
  const auto [stop, error] = std::from_chars(first, text_.data() + text_.size(), number);
  if (error == std::errc::invalid_argument) return fail(start, std::string(what) + " expected");
  if (error != std::errc{} || !std::isfinite(number)) {
    number = 0.0;
    return fail(start, std::string(what) + " is out of range");
  }
  position_ += static_cast<std::size_t>(stop - first);
  return true;
}

bool DbcScanner::read_quoted(std::string& text) {
  skip_blanks();
  const std::size_t start = position_;
  if (!accept('"')) return fail("text in quotes expected");
  text.clear();
  for (std::size_t i = position_; i < text_.size(); ++i) {
    if (text_[i] == '"') {
      position_ = i + 1;
      return true;
    }
    if (text_[i] == '\\' && i + 1 < text_.size() && text_[i + 1] == '"') ++i;
    text += text_[i];
  }
  return fail(start, "text is not closed");
}

bool DbcScanner::fail(std::size_t position, const std::string& text) {
  problems_.emplace_back(position, text);
  return false;
}

std::vector<DbcProblem> DbcScanner::problems() const {
  auto sorted = problems_;
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<DbcProblem> placed;
  placed.reserve(sorted.size());
  std::size_t at = 0;
  int line = 1, column = 1;
  for (auto& [position, text] : sorted) {
    for (; at < position && at < text_.size(); ++at) {
      if (text_[at] == '\n') {
        ++line;
        column = 1;
      } else if (!continues_character(text_[at])) {
        ++column;
      }
    }
    placed.push_back({line, column, std::move(text)});
  }
  return placed;
}

}  // namespace holdfast
