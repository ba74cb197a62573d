#pragma once

#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "drivers/can/dbc_scanner.h"

namespace holdfast {

/// Reads the statements of one DBC file; what parse_dbc() is made of. Not for users.
class DbcReader : private DbcScanner {
 public:
  using DbcScanner::DbcScanner;
  Dbc read();

 private:
  using Handler = bool (DbcReader::*)();
  struct SignalDraft {
    DbcSignal signal;
    bool is_multiplexed = false;
    std::string selector;              // that SG_MUL_VAL_ names
    std::size_t selection_offset = 0;  // where the selector is named; else of the signal itself
    bool is_left_out = false;
  };
  struct MessageDraft {
    DbcMessage message;
    std::uint32_t file_identifier = 0;
    std::vector<SignalDraft> signals;
  };

  static Handler handler_of(std::string_view keyword);

  // Statements; false after a problem, then reading goes on in the next line.
  bool read_message();
  bool read_signal();
  bool read_value_type();
  bool read_value_names();
  bool read_selector_ranges();
  bool read_attribute_definition();
  bool read_attribute_default();
  bool read_attribute();
  bool skip_comment();
  bool skip_unused_line() { return skip_line(); }
  bool skip_statement();
  bool skip_symbol_list();

  bool read_signal_layout(DbcSignal& signal);
  bool read_multiplexing(SignalDraft& draft);
  bool add_message(MessageDraft draft, std::size_t offset);
  SignalDraft* read_signal_reference(bool& is_good);
  bool read_selection(SignalDraft& draft);
  void finish(MessageDraft& draft, Dbc& dbc);
  void find_selectors(MessageDraft& draft);
  void leave_out_unreachable(MessageDraft& draft);
  bool leave_out(SignalDraft& draft, std::size_t offset, const std::string& reason);
  bool is_fd(const MessageDraft& draft) const;

  std::vector<MessageDraft> messages_;
  std::unordered_map<std::uint32_t, std::size_t> index_of_;  // by identifier as the file writes it
  std::set<std::string> message_names_;
  MessageDraft* current_ = nullptr;  // that SG_ lines belong to; valid until the next BO_
  bool signals_are_left_out_ = false;
  std::set<std::uint32_t> left_out_messages_;
  std::set<std::pair<std::uint32_t, std::string>> left_out_signals_;
  std::vector<std::string> frame_format_names_;
  std::string default_frame_format_;
  std::unordered_map<std::uint32_t, std::string> frame_formats_;
};

}  // namespace holdfast
