#include "drivers/can/dbc.h"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <sstream>

#include "common/errors.h"
#include "drivers/can/dbc_reader.h"

namespace holdfast {
namespace {

constexpr std::uint32_t kExtendedBit = 0x80000000U;
// Pseudo message that holds signals which no message has.
constexpr const char* kIndependentSignals = "VECTOR__INDEPENDENT_SIG_MSG";
constexpr const char* kNobody = "Vector__XXX";

// Statements that say nothing about message layouts; they end with a semicolon.
constexpr std::string_view kSkippedStatements[] = {
    "VAL_TABLE_", "BO_TX_BU_",        "EV_",         "ENVVAR_DATA_",
    "EV_DATA_",   "SGTYPE_",          "SGTYPE_VAL_", "SIG_TYPE_REF_",
    "SIG_GROUP_", "SIGTYPE_VALTYPE_", "BA_DEF_REL_", "BA_DEF_DEF_REL_",
    "BA_REL_",    "BA_DEF_SGTYPE_",   "BA_SGTYPE_",  "CAT_DEF_",
    "CAT_",       "FILTER",           "BU_SG_REL_",  "BU_EV_REL_",
    "BU_BO_REL_"};

}  // namespace

std::optional<std::string> read_dbc_file(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream content;
  // A folder opens like a file and only fails when it is read.
  if (!stream || !(content << stream.rdbuf())) return std::nullopt;
  return content.str();
}

Dbc DbcReader::read() {
  while (true) {
    skip_space();
    if (at_end()) break;
    const std::size_t start = position();
    const std::string_view name = keyword();
    const Handler handler = handler_of(name);
    bool is_good = false;
    if (handler == nullptr) {
      fail(start, name.empty() ? "no DBC statement"
                               : "'" + std::string(name.substr(0, 40)) + "' is no DBC keyword");
    } else {
      move_to(start + name.size());
      is_good = (this->*handler)();
    }
    // From the line after the start, so that an open quote takes no other statement with it.
    if (!is_good) move_to(line_end(start));
  }
  Dbc dbc;
  for (MessageDraft& draft : messages_) finish(draft, dbc);
  dbc.problems = problems();
  return dbc;
}

DbcReader::Handler DbcReader::handler_of(std::string_view keyword) {
  static constexpr std::pair<std::string_view, Handler> kHandlers[] = {
      {"BO_", &DbcReader::read_message},
      {"SG_", &DbcReader::read_signal},
      {"SIG_VALTYPE_", &DbcReader::read_value_type},
      {"VAL_", &DbcReader::read_value_names},
      {"SG_MUL_VAL_", &DbcReader::read_selector_ranges},
      {"BA_DEF_", &DbcReader::read_attribute_definition},
      {"BA_DEF_DEF_", &DbcReader::read_attribute_default},
      {"BA_", &DbcReader::read_attribute},
      {"CM_", &DbcReader::skip_comment},
      {"VERSION", &DbcReader::skip_unused_line},
      {"BS_", &DbcReader::skip_unused_line},
      {"BU_", &DbcReader::skip_unused_line},
      {"NS_", &DbcReader::skip_symbol_list}};
  for (const auto& [name, handler] : kHandlers) {
    if (name == keyword) return handler;
  }
  const auto* end = std::end(kSkippedStatements);
  return std::find(std::begin(kSkippedStatements), end, keyword) != end ? &DbcReader::skip_statement
                                                                        : nullptr;
}

bool DbcReader::read_message() {
  current_ = nullptr;
  signals_are_left_out_ = true;
  const std::size_t offset = position();
  MessageDraft draft;
  std::int64_t identifier = 0, num_bytes = 0;
  if (!read_whole(identifier, "identifier")) return false;
  if (identifier < 0 || identifier > 0xFFFFFFFF) return fail(offset, "identifier is out of range");
  draft.file_identifier = static_cast<std::uint32_t>(identifier);
  left_out_messages_.insert(draft.file_identifier);
  if (!read_word(draft.message.name, "name of a message") || !expect(':')) return false;
  if (draft.message.name == kIndependentSignals) return skip_line();
  if (!read_whole(num_bytes, "number of bytes")) return false;
  if (num_bytes < 0 || num_bytes > static_cast<std::int64_t>(CanFrame::kBytesMax)) {
    return fail(offset, "message '" + draft.message.name + "' must have 0 to 64 bytes");
  }
  draft.message.num_bytes = static_cast<std::uint8_t>(num_bytes);
  skip_blanks();
  if (peek() != '\n' && !read_word(draft.message.sender, "name of the sender")) return false;
  if (draft.message.sender == kNobody) draft.message.sender.clear();
  return add_message(std::move(draft), offset) && skip_line();
}

bool DbcReader::add_message(MessageDraft draft, std::size_t offset) {
  DbcMessage& message = draft.message;
  message.is_extended = (draft.file_identifier & kExtendedBit) != 0;
  message.identifier = draft.file_identifier & ~kExtendedBit;
  if (message.identifier > (message.is_extended ? 0x1FFFFFFFU : 0x7FFU)) {
    return fail(offset, "identifier of '" + message.name + "' has too many bits" +
                            (message.is_extended ? "" : " (bit 31 marks a 29-bit one)"));
  }
  if (index_of_.contains(draft.file_identifier)) {
    // The first one is kept and stays in force.
    left_out_messages_.erase(draft.file_identifier);
    return fail(offset, "identifier of '" + message.name + "' is given twice");
  }
  if (!message_names_.insert(message.name).second) {
    return fail(offset, "message '" + message.name + "' is given twice");
  }
  left_out_messages_.erase(draft.file_identifier);
  signals_are_left_out_ = false;
  index_of_[draft.file_identifier] = messages_.size();
  messages_.push_back(std::move(draft));
  current_ = &messages_.back();
  return true;
}

bool DbcReader::read_signal() {
  if (current_ == nullptr)
    return signals_are_left_out_ ? skip_line() : fail("signal outside a message");
  skip_blanks();
  const std::size_t offset = position();
  SignalDraft draft;
  draft.selection_offset = offset;
  if (!read_word(draft.signal.name, "name of a signal")) return false;
  const std::string& name = draft.signal.name;
  const auto left_out = left_out_signals_.emplace(current_->file_identifier, name).first;
  if (!read_multiplexing(draft) || !expect(':')) return false;
  if (!read_signal_layout(draft.signal)) return false;
  for (const SignalDraft& other : current_->signals) {
    if (other.signal.name == name) {
      left_out_signals_.erase(left_out);
      return fail(offset, "signal '" + name + "' is given twice");
    }
  }
  if (!draft.signal.fits(current_->message.num_bytes)) {
    return fail(offset, "signal '" + name + "' does not fit into the " +
                            std::to_string(current_->message.num_bytes) + " bytes of '" +
                            current_->message.name + "'");
  }
  left_out_signals_.erase(left_out);
  current_->signals.push_back(std::move(draft));
  return skip_line();
}

bool DbcReader::read_multiplexing(SignalDraft& draft) {
  skip_blanks();
  if (peek() == ':') return true;
  const std::size_t offset = position();
  std::string mark;
  if (!read_word(mark, "':' or the multiplexing (M, m0, m0M)")) return false;
  draft.signal.is_selector = mark.back() == 'M';
  draft.is_multiplexed = mark != "M";
  if (!draft.is_multiplexed) return true;
  std::int64_t value = 0;
  const char* end = mark.data() + mark.size() - (draft.signal.is_selector ? 1 : 0);
  const auto [stop, error] = std::from_chars(mark.data() + 1, end, value);
  if (mark[0] != 'm' || error != std::errc{} || stop != end || value < 0)
    return fail(offset, "multiplexing must be M, or m and a number, then M where it selects, too");
  draft.signal.selector_ranges = {{value, value}};
  return true;
}

bool DbcReader::read_signal_layout(DbcSignal& signal) {
  skip_blanks();
  const std::size_t offset = position();
  std::int64_t start = 0, bits = 0, order = 0;
  if (!read_whole(start, "start bit") || !expect('|') || !read_whole(bits, "number of bits"))
    return false;
  if (start < 0 || start > 511) return fail(offset, "start bit must be in 0 to 511");
  if (bits < 1 || bits > 64) return fail(offset, "number of bits must be in 1 to 64");
  if (!expect('@')) return false;
  const std::size_t order_offset = position();
  if (!read_whole(order, "byte order")) return false;
  if (order != 0 && order != 1) {
    return fail(order_offset, "byte order must be 0 (Motorola) or 1 (Intel)");
  }
  signal.start_bit = static_cast<int>(start);
  signal.num_bits = static_cast<int>(bits);
  signal.is_little_endian = order == 1;
  if (accept('-')) {
    signal.kind = DbcSignal::Kind::kSigned;
  } else if (!accept('+')) {
    return fail("'+' (unsigned) or '-' (signed) expected");
  }
  if (!expect('(')) return false;
  const std::size_t scale_offset = position();
  if (!read_number(signal.scale, "scale") || !expect(',')) return false;
  if (!read_number(signal.offset, "offset") || !expect(')')) return false;
  if (signal.scale == 0.0) return fail(scale_offset, "scale must not be 0");
  if (!expect('[') || !read_number(signal.minimum, "minimum") || !expect('|')) return false;
  if (!read_number(signal.maximum, "maximum") || !expect(']')) return false;
  skip_blanks();
  const std::size_t unit_offset = position();
  const std::size_t end_of_line = line_end(position());
  if (!read_quoted(signal.unit)) return false;
  return position() <= end_of_line || fail(unit_offset, "text is not closed in its line");
}

Dbc parse_dbc(const std::string& text) {
  return DbcReader(text).read();
}

const DbcMessage& require_message(const Dbc& dbc, const std::string& name) {
  const DbcMessage* message = dbc.find(name);
  if (message == nullptr) throw UsageError("the DBC has no message " + name);
  return *message;
}

const DbcSignal& require_signal(const DbcMessage& message, const std::string& name) {
  const DbcSignal* signal = message.find(name);
  if (signal == nullptr) throw UsageError("message " + message.name + " has no signal " + name);
  return *signal;
}

}  // namespace holdfast
