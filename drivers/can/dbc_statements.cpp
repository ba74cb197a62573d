#include <charconv>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "drivers/can/dbc_reader.h"

namespace holdfast {
namespace {

constexpr const char* kFrameFormat = "VFrameFormat";

bool is_float(const DbcSignal& signal) {
  return signal.kind == DbcSignal::Kind::kFloat32 || signal.kind == DbcSignal::Kind::kFloat64;
}

}  // namespace

// Reads "identifier signal". Null with is_good when the signal was left out on purpose: the reason
// is told already.
DbcReader::SignalDraft* DbcReader::read_signal_reference(bool& is_good) {
  is_good = false;
  skip_blanks();
  const std::size_t offset = position();
  std::int64_t number = 0;
  std::string name;
  if (!read_whole(number, "identifier") || !read_word(name, "name of a signal")) return nullptr;
  const auto identifier = static_cast<std::uint32_t>(number);
  if (const auto found = index_of_.find(identifier);
      found != index_of_.end() && number == identifier) {
    for (SignalDraft& draft : messages_[found->second].signals) {
      if (draft.signal.name != name) continue;
      is_good = true;
      return &draft;
    }
  }
  is_good =
      left_out_messages_.contains(identifier) || left_out_signals_.contains({identifier, name});
  if (!is_good)
    fail(offset, "no message " + std::to_string(number) + " with a signal '" + name + "'");
  return nullptr;
}

bool DbcReader::read_value_type() {
  bool is_good = false;
  SignalDraft* draft = read_signal_reference(is_good);
  if (draft == nullptr) return is_good && skip_statement();
  accept(':');
  skip_blanks();
  const std::size_t offset = position();
  std::int64_t type = 0;
  if (!read_whole(type, "type of a value")) return false;
  DbcSignal& signal = draft->signal;
  if (type == 1 && signal.num_bits == 32) {
    signal.kind = DbcSignal::Kind::kFloat32;
  } else if (type == 2 && signal.num_bits == 64) {
    signal.kind = DbcSignal::Kind::kFloat64;
  } else if (type != 0) {
    // Its values would be read as what they are not.
    leave_out(*draft, offset, "type must be 0, 1 (32 bits) or 2 (64 bits)");
  }
  if (type != 0 && signal.is_selector && !draft->is_left_out)
    fail(offset, "'" + signal.name + "' is a float and cannot select: what it selects is left out");
  return skip_statement();
}

bool DbcReader::read_value_names() {
  skip_blanks();
  // An environment variable has names too, and no identifier before them.
  if (peek() < '0' || peek() > '9') return skip_statement();
  bool is_good = false;
  SignalDraft* draft = read_signal_reference(is_good);
  if (draft == nullptr) return is_good && skip_statement();
  while (true) {
    skip_space();
    if (at_end() || accept(';') || handler_of(keyword()) != nullptr) return true;
    std::int64_t value = 0;
    std::string name;
    if (!read_whole(value, "value or ';'") || !read_quoted(name)) return false;
    draft->signal.value_names[value] = std::move(name);
  }
}

bool DbcReader::read_selector_ranges() {
  bool is_good = false;
  SignalDraft* draft = read_signal_reference(is_good);
  if (draft == nullptr) return is_good && skip_statement();
  if (read_selection(*draft)) return skip_statement();
  // Without its ranges a multiplexed signal would be taken to be there when it is not.
  draft->is_left_out = draft->is_left_out || draft->is_multiplexed;
  return false;
}

bool DbcReader::read_selection(SignalDraft& draft) {
  skip_blanks();
  const std::size_t offset = position();
  if (!read_word(draft.selector, "name of the selecting signal")) return false;
  if (!draft.is_multiplexed)
    return fail(offset, "'" + draft.signal.name + "' is not multiplexed (m0)");
  draft.selection_offset = offset;
  draft.signal.selector_ranges.clear();
  do {
    std::int64_t first = 0, last = 0;
    skip_blanks();
    const std::size_t range_offset = position();
    if (!read_whole(first, "first value") || !expect('-')) return false;
    if (!read_whole(last, "last value")) return false;
    if (first > last) return leave_out(draft, range_offset, "first value lies above the last");
    draft.signal.selector_ranges.emplace_back(first, last);
  } while (accept(','));
  return true;
}

bool DbcReader::read_attribute_definition() {
  skip_blanks();
  if (keyword() != "BO_") return skip_statement();
  move_to(position() + 3);
  std::string name, type;
  if (!read_quoted(name) || !read_word(type, "type of the attribute")) return false;
  if (name != kFrameFormat || type != "ENUM") return skip_statement();
  frame_format_names_.clear();
  do {
    std::string choice;
    if (!read_quoted(choice)) return false;
    frame_format_names_.push_back(std::move(choice));
  } while (accept(','));
  return skip_statement();
}

bool DbcReader::read_attribute_default() {
  std::string name;
  if (!read_quoted(name)) return false;
  if (name != kFrameFormat) return skip_statement();
  skip_blanks();
  default_frame_format_.clear();
  if (peek() == '"') return read_quoted(default_frame_format_) && skip_statement();
  return read_word(default_frame_format_, "value of the attribute") && skip_statement();
}

bool DbcReader::read_attribute() {
  std::string name;
  if (!read_quoted(name)) return false;
  skip_blanks();
  if (name != kFrameFormat || keyword() != "BO_") return skip_statement();
  move_to(position() + 3);
  std::int64_t identifier = 0;
  if (!read_whole(identifier, "identifier")) return false;
  skip_blanks();
  std::string format;
  const bool is_good =
      peek() == '"' ? read_quoted(format) : read_word(format, "value of the attribute");
  if (is_good) frame_formats_[static_cast<std::uint32_t>(identifier)] = format;
  return is_good && skip_statement();
}

void DbcReader::finish(MessageDraft& draft, Dbc& dbc) {
  DbcMessage& message = draft.message;
  message.is_fd = is_fd(draft);
  find_selectors(draft);
  leave_out_unreachable(draft);
  std::vector<int> place_of;  // by place among the drafts
  int num_kept = 0;
  for (const SignalDraft& signal : draft.signals)
    place_of.push_back(signal.is_left_out ? -1 : num_kept++);
  for (SignalDraft& signal : draft.signals) {
    if (signal.is_left_out) continue;
    int& selector = signal.signal.selector;
    if (selector >= 0) selector = place_of[static_cast<std::size_t>(selector)];
    message.signals.push_back(std::move(signal.signal));
  }
  dbc.messages.push_back(std::move(message));
}

// Notes why; false.
bool DbcReader::leave_out(SignalDraft& draft, std::size_t offset, const std::string& reason) {
  draft.is_left_out = true;
  return fail(offset, reason + ": '" + draft.signal.name + "' is left out");
}

// The selector that SG_MUL_VAL_ names, else the only one that is always there. A float, whose
// values are no whole numbers, selects nothing.
void DbcReader::find_selectors(MessageDraft& draft) {
  std::unordered_map<std::string_view, int> place_of;  // selectors'
  std::vector<int> always;
  for (std::size_t i = 0; i < draft.signals.size(); ++i) {
    const SignalDraft& signal = draft.signals[i];
    if (!signal.signal.is_selector) continue;
    place_of.emplace(signal.signal.name, static_cast<int>(i));
    if (!signal.is_multiplexed && !signal.is_left_out) always.push_back(static_cast<int>(i));
  }
  const std::string none = "message '" + draft.message.name + "' has no selector (M)";
  for (SignalDraft& signal : draft.signals) {
    if (!signal.is_multiplexed || signal.is_left_out) continue;
    const auto named = place_of.find(signal.selector);
    if (named != place_of.end()) {
      signal.signal.selector = named->second;
    } else if (!signal.selector.empty()) {
      leave_out(signal, signal.selection_offset, none + " '" + signal.selector + "'");
    } else if (always.size() == 1) {
      signal.signal.selector = always.front();
    } else {
      leave_out(signal, signal.selection_offset,
                always.empty() ? none : "of several selectors no SG_MUL_VAL_ says which is its");
    }
  }
  for (SignalDraft& signal : draft.signals) {
    if (signal.is_left_out || !signal.signal.is_multiplexed()) continue;
    const DbcSignal& selector =
        draft.signals[static_cast<std::size_t>(signal.signal.selector)].signal;
    if (is_float(selector))
      leave_out(signal, signal.selection_offset, "its selector '" + selector.name + "' is a float");
  }
  for (SignalDraft& signal : draft.signals)
    signal.signal.is_selector = signal.signal.is_selector && !is_float(signal.signal);
}

// What is selected by what is left out, or in a circle, can never be told to be there.
void DbcReader::leave_out_unreachable(MessageDraft& draft) {
  std::vector<std::vector<std::size_t>> selected_by(draft.signals.size());
  std::vector<std::size_t> reached;
  for (std::size_t i = 0; i < draft.signals.size(); ++i) {
    const SignalDraft& signal = draft.signals[i];
    if (signal.is_left_out) continue;
    auto& list = signal.signal.is_multiplexed()
                     ? selected_by[static_cast<std::size_t>(signal.signal.selector)]
                     : reached;
    list.push_back(i);
  }
  std::vector<bool> is_reached(draft.signals.size());
  for (std::size_t next = 0; next < reached.size(); ++next) {
    const std::size_t place = reached[next];
    is_reached[place] = true;
    reached.insert(reached.end(), selected_by[place].begin(), selected_by[place].end());
  }
  for (std::size_t i = 0; i < draft.signals.size(); ++i) {
    SignalDraft& signal = draft.signals[i];
    if (!signal.is_left_out && !is_reached[i])
      leave_out(signal, signal.selection_offset, "its selectors end at none that is always there");
  }
}

bool DbcReader::is_fd(const MessageDraft& draft) const {
  if (draft.message.num_bytes > 8) return true;
  const auto found = frame_formats_.find(draft.file_identifier);
  std::string format = found != frame_formats_.end() ? found->second : default_frame_format_;
  std::size_t number = 0;
  const char* end = format.data() + format.size();
  const auto [stop, error] = std::from_chars(format.data(), end, number);
  if (error == std::errc{} && stop == end) {
    if (number >= frame_format_names_.size()) return number == 14 || number == 15;
    format = frame_format_names_[number];
  }
  return format.find("FD") != std::string::npos;
}

bool DbcReader::skip_comment() {
  // Up to the text there are an object's kind and names.
  while (peek() != '"') {
    if (at_end() || peek() == ';') return skip_statement();
    move_to(position() + 1);
  }
  const std::size_t quote = position();
  std::string comment;
  if (!read_quoted(comment)) return false;
  skip_blanks();
  if (accept(';') || peek() == '\n') return true;
  // More text: quotes inside the comment, or this one was never closed and met another's. The
  // former when the line ends like a comment; otherwise no following line may be swallowed.
  move_to(quote);
  if (line_ends_with(quote + 1, "\";")) return skip_line();
  return fail(quote, "comment is not closed, or has quotes inside");
}

bool DbcReader::skip_statement() {
  std::string ignored;
  while (!at_end() && !accept(';')) {
    if (peek() == '"') {
      if (!read_quoted(ignored)) return false;
      continue;
    }
    const bool is_line_end = peek() == '\n';
    if (!at_end()) move_to(position() + 1);
    if (!is_line_end) continue;
    // Some writers forget the semicolon.
    skip_space();
    if (handler_of(keyword()) != nullptr) return true;
  }
  return true;
}

bool DbcReader::skip_symbol_list() {
  skip_line();
  // Each line of the list holds one keyword and nothing else.
  while (!at_end()) {
    const std::size_t start = position();
    skip_space();
    const std::size_t length = keyword().size();
    move_to(position() + length);
    skip_blanks();
    if (length > 0 && peek() == '\n') continue;
    move_to(start);
    break;
  }
  return true;
}

}  // namespace holdfast
