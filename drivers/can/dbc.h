#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "drivers/can/can_frame.h"

namespace holdfast {

/// One signal of a message layout.
struct DbcSignal {
  enum class Kind { kUnsigned, kSigned, kFloat32, kFloat64 };

  std::string name;
  int start_bit = 0;  // as DBC counts: bit b is bit b % 8 of byte b / 8
  int num_bits = 1;   // 1..64
  bool is_little_endian = true;
  Kind kind = Kind::kUnsigned;
  double scale = 1.0;
  double offset = 0.0;
  double minimum = 0.0, maximum = 0.0;  // both 0: no limits
  std::string unit;
  bool is_selector = false;  // M or mNM, and no float: it may say which others are there
  /// Of a multiplexed signal: where its selector, which may be multiplexed in its turn, stands
  /// among the message's signals. Below 0: the signal is always there.
  int selector = -1;
  /// First and last values of the selector that carry the signal: of SG_MUL_VAL_, or N of mN.
  std::vector<std::pair<std::int64_t, std::int64_t>> selector_ranges;
  std::map<std::int64_t, std::string> value_names;  // VAL_

  /// Raw bits of the signal in the data, sign-extended when signed. Precondition: fits(num_bytes).
  std::uint64_t raw(std::span<const std::uint8_t> data) const;
  void set_raw(std::span<std::uint8_t> data, std::uint64_t raw) const;
  /// Physical value raw * scale + offset.
  double unpack(std::span<const std::uint8_t> data) const;
  /// Packs the nearest representable value, saturating at the ends of the raw range; a half step is
  /// rounded away from zero. NaN in an integer signal is packed as raw 0. Returns false for NaN in
  /// an integer signal and for a value beyond the range (rounding to the raw grid is no failure).
  bool pack(std::span<std::uint8_t> data, double value) const;
  /// True when every bit of the signal lies inside num_bytes.
  bool fits(std::size_t num_bytes) const;
  bool is_multiplexed() const { return selector >= 0; }
  /// Of a multiplexed signal: true when its selector's value carries it.
  bool is_selected_by(std::int64_t selector_value) const;
};

struct DbcMessage {
  std::string name;
  std::uint32_t identifier = 0;
  bool is_extended = false;
  std::uint8_t num_bytes = 0;
  bool is_fd = false;  // VFrameFormat 14 or 15, or more than 8 bytes
  std::string sender;
  std::vector<DbcSignal> signals;

  const DbcSignal* find(const std::string& signal_name) const;
  /// Null for a signal that is not multiplexed.
  const DbcSignal* selector_of(const DbcSignal& signal) const;
  /// True when the signal is in the data: they are long enough, and its selector is in them and has
  /// a value that carries it.
  bool carries(const DbcSignal& signal, std::span<const std::uint8_t> data) const;
  /// The same of each of the signals, in one walk.
  std::vector<bool> carried_signals(std::span<const std::uint8_t> data) const;
  /// Frame with zero data, right identifier, flags and length (of FD: the next length there is).
  CanFrame empty_frame() const;
  /// The same, but each selector on the way up from these signals of the message has the least
  /// value that carries what it selects of them. None when no frame carries them together.
  std::optional<CanFrame> frame_for(const std::vector<DbcSignal>& wanted) const;
  /// True when identifier, width, format and length of the frame are those of this message.
  bool matches(const CanFrame& frame) const;
};

struct DbcProblem {
  int line = 0, column = 0;
  std::string text;
};

/// A DBC file, as far as message layouts need it.
struct Dbc {
  std::vector<DbcMessage> messages;
  std::vector<DbcProblem> problems;  // lines that were not understood and left out

  const DbcMessage* find(const std::string& name) const;
  const DbcMessage* find(std::uint32_t identifier, bool is_extended) const;
};

/// The same, but throw UsageError, which names what is missing.
const DbcMessage& require_message(const Dbc& dbc, const std::string& name);
const DbcSignal& require_signal(const DbcMessage& message, const std::string& name);

/// The bytes of a DBC file; none when it cannot be read, or is empty.
std::optional<std::string> read_dbc_file(const std::string& file);

/// Reads DBC text; never throws for its content: what is not understood is listed in problems, in
/// order of lines (from 1) and columns (bytes, from 1; a byte order mark does not count).
///
/// Line ends may be LF, CRLF or CR; text that is not UTF-8 is read as Windows-1252. A signal that
/// does not fit its message, or of which cannot be told when it is there, is a problem and is left
/// out: up from each signal that is kept its selectors, which are whole numbers, end at one that is
/// always there.
Dbc parse_dbc(const std::string& text);

/// The text in UTF-8, without byte order mark: what is not UTF-8 already is read as Windows-1252,
/// the encoding of most DBC files.
std::string utf8_text(std::string_view text);

}  // namespace holdfast
