#include "tools/dbc_tool.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <istream>
#include <limits>
#include <optional>
#include <ostream>
#include <set>
#include <span>

#include "common/errors.h"
#include "drivers/can/candump_log.h"
#include "drivers/can/hex_bytes.h"
#include "tools/log_csv.h"
#include "tools/printable_text.h"
#include "tools/text_table.h"

namespace holdfast {
namespace {

std::string number_of(double value) {
  char text[40];
  const auto [end, error] = std::to_chars(text, text + sizeof text, value);
  return {text, end};
}

const char* kind_text(const DbcSignal& signal) {
  switch (signal.kind) {
    case DbcSignal::Kind::kUnsigned:
      return "unsigned";
    case DbcSignal::Kind::kSigned:
      return "signed";
    case DbcSignal::Kind::kFloat32:
      return "float32";
    case DbcSignal::Kind::kFloat64:
      break;
  }
  return "float64";
}

std::string selector_ranges_text(const DbcSignal& signal) {
  std::string text;
  for (const auto& [first, last] : signal.selector_ranges) {
    text += (text.empty() ? "" : ", ") + std::to_string(first);
    if (last != first) text += "-" + std::to_string(last);
  }
  return text;
}

// The selector is named only where there are several.
std::string multiplexing_text(const DbcMessage& message, const DbcSignal& signal) {
  std::string text;
  if (const DbcSignal* selector = message.selector_of(signal)) {
    const bool is_only = std::ranges::count_if(message.signals, &DbcSignal::is_selector) == 1;
    text = is_only ? "when " : "when " + printable(selector->name, 100) + " ";
    text += selector_ranges_text(signal);
  }
  if (signal.is_selector) text += text.empty() ? "selects" : "; selects";
  return text;
}

std::string range_text(const DbcSignal& signal) {
  if (signal.minimum == 0.0 && signal.maximum == 0.0) return "";
  return number_of(signal.minimum) + ".." + number_of(signal.maximum);
}

std::string scale_text(const DbcSignal& signal) {
  if (signal.scale == 1.0 && signal.offset == 0.0) return "";
  std::string text = "x " + number_of(signal.scale);
  if (signal.offset != 0.0)
    text += (signal.offset > 0.0 ? " + " : " - ") + number_of(std::abs(signal.offset));
  return text;
}

std::string names_text(const DbcSignal& signal) {
  std::string text;
  for (const auto& [value, name] : signal.value_names)
    text += (text.empty() ? "" : ", ") + std::to_string(value) + " " + name;
  return text;
}

bool is_whole(const DbcSignal& signal) {
  return signal.kind == DbcSignal::Kind::kUnsigned || signal.kind == DbcSignal::Kind::kSigned;
}

std::string raw_text(const DbcSignal& signal, std::span<const std::uint8_t> data) {
  const std::uint64_t raw = signal.raw(data);
  return signal.kind == DbcSignal::Kind::kSigned ? std::to_string(static_cast<std::int64_t>(raw))
                                                 : std::to_string(raw);
}

// A double does not hold every number of 64 bits: where the bits are the value, none is needed.
bool is_raw_value(const DbcSignal& signal) {
  return is_whole(signal) && signal.scale == 1.0 && signal.offset == 0.0;
}

std::string value_text(const DbcSignal& signal, std::span<const std::uint8_t> data) {
  return is_raw_value(signal) ? raw_text(signal, data) : number_of(signal.unpack(data));
}

const std::string* name_of_value(const DbcSignal& signal, std::span<const std::uint8_t> data) {
  const auto found = signal.value_names.find(static_cast<std::int64_t>(signal.raw(data)));
  return found == signal.value_names.end() ? nullptr : &found->second;
}

void write_frame(const CandumpRecord& record, const DbcMessage& message, std::ostream& csv) {
  char time[40];
  std::snprintf(time, sizeof time, "%.6f", static_cast<double>(record.time_ns) * 1e-9);
  const CanFrame& frame = record.frame;
  const std::vector<bool> is_carried = message.carried_signals(frame.bytes());
  for (std::size_t i = 0; i < message.signals.size(); ++i) {
    if (!is_carried[i]) continue;
    const DbcSignal& signal = message.signals[i];
    const std::string* name = name_of_value(signal, frame.bytes());
    csv << time << ',' << csv_text(record.interface_name) << ',' << identifier_text(frame) << ','
        << csv_text(message.name) << ',' << csv_text(signal.name) << ','
        << value_text(signal, frame.bytes()) << ',' << csv_text(signal.unit) << ','
        << (name == nullptr ? "" : csv_text(*name)) << '\n';
  }
}

template <class Number>
std::optional<Number> parsed(const std::string& text) {
  Number number{};
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, number);
  return !text.empty() && error == std::errc{} && stop == end ? std::optional(number)
                                                              : std::nullopt;
}

// The raw bits of a signal whose value they are; none for a text that is no whole number.
std::optional<std::uint64_t> raw_of(const DbcSignal& signal, const std::string& text) {
  if (!is_raw_value(signal)) return std::nullopt;
  if (signal.kind == DbcSignal::Kind::kUnsigned) return parsed<std::uint64_t>(text);
  const auto number = parsed<std::int64_t>(text);
  return number ? std::optional(static_cast<std::uint64_t>(*number)) : std::nullopt;
}

std::int64_t value_of_name(const DbcSignal& signal, const std::string& name) {
  for (const auto& [value, value_name] : signal.value_names) {
    if (value_name == name) return value;
  }
  throw UsageError(signal.name + ": '" + name + "' is neither a number nor a name of its values" +
                   (signal.value_names.empty() ? "" : ": " + names_text(signal)));
}

// Whether the bits may say another number than this one, which was packed as a double.
bool is_rounded(const DbcSignal& signal, double value) {
  constexpr double kInexact = 9007199254740992.0;  // from it on doubles skip whole numbers
  constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
  if (!is_whole(signal)) return false;
  const double steps = (value - signal.offset) / signal.scale;
  const double of_arithmetic =
      4.0 * kEpsilon * (std::abs(value) + std::abs(signal.offset)) / std::abs(signal.scale);
  return std::abs(steps) >= kInexact || std::abs(steps - std::round(steps)) > 1e-6 + of_arithmetic;
}

// Writes what the text says; what the signal does not say like that is remarked.
void write_value(const DbcSignal& signal, const std::string& text, std::span<std::uint8_t> data,
                 std::vector<std::string>& remarks) {
  const std::optional<double> number = parsed<double>(text);
  std::optional<std::uint64_t> raw = raw_of(signal, text);
  double value = number.value_or(0.0);
  if (!number) {
    const std::int64_t named = value_of_name(signal, text);
    value = static_cast<double>(named) * signal.scale + signal.offset;
    if (is_whole(signal)) raw = static_cast<std::uint64_t>(named);
  }
  if (raw) signal.set_raw(data, *raw);
  if (raw ? signal.raw(data) != *raw : !signal.pack(data, value))
    throw UsageError(signal.name + ": " + text + " does not fit its " +
                     std::to_string(signal.num_bits) + " bits");
  if (!raw && is_rounded(signal, value))
    remarks.push_back(signal.name + ": " + text + " is written as " + value_text(signal, data) +
                      " (raw " + raw_text(signal, data) + ")");
  const std::string range = range_text(signal);
  if (!range.empty() && !(signal.minimum <= value && value <= signal.maximum))
    remarks.push_back(signal.name + ": " + text + " lies outside " + range);
}

// Of a signal that no frame carries: the selector above it that cannot have the value it needs.
std::string impossible_selection(const DbcMessage& message, const DbcSignal& signal) {
  std::string text;
  const DbcSignal* selected = &signal;
  while (const DbcSignal* selector = message.selector_of(*selected)) {
    if (!message.frame_for({*selected}))
      text = selector->name + " (" + std::to_string(selector->num_bits) + " bits, " +
             kind_text(*selector) + ") would have to be " + selector_ranges_text(*selected);
    selected = selector;
  }
  return text;
}

[[noreturn]] void refuse_together(const DbcMessage& message,
                                  const std::vector<DbcSignal>& signals) {
  for (const DbcSignal& signal : signals) {
    if (!message.frame_for({signal}))
      throw UsageError("no frame of " + message.name + " carries " + signal.name + ": " +
                       impossible_selection(message, signal));
  }
  throw UsageError("no frame of " + message.name + " carries all of these signals together");
}

}  // namespace

Dbc load_dbc(const std::string& file) {
  const std::optional<std::string> text = read_dbc_file(file);
  if (!text) throw UsageError(file + ": cannot be read, or is empty");
  return parse_dbc(*text);
}

std::string problems_text(const Dbc& dbc, const std::string& file) {
  std::string text;
  for (const DbcProblem& problem : dbc.problems)
    text += file + ":" + std::to_string(problem.line) + ":" + std::to_string(problem.column) +
            ": " + problem.text + "\n";
  return text;
}

std::string list_text(const Dbc& dbc) {
  std::string text;
  for (const DbcMessage& message : dbc.messages) {
    text += identifier_text(message.empty_frame()) + "  " + printable(message.name, 100) + "  " +
            std::to_string(message.num_bytes) + " bytes" + (message.is_fd ? " FD" : "") +
            (message.sender.empty() ? "" : "  from " + printable(message.sender, 60)) + "\n";
    TextTable table(7);
    for (const DbcSignal& signal : message.signals) {
      table.add({"  " + printable(signal.name, 100),
                 std::to_string(signal.start_bit) + "|" + std::to_string(signal.num_bits) +
                     (signal.is_little_endian ? " Intel" : " Motorola"),
                 kind_text(signal), scale_text(signal), range_text(signal),
                 printable(signal.unit, 40), multiplexing_text(message, signal),
                 printable(names_text(signal), 400)});
    }
    text += table.text();
  }
  return text;
}

DecodeCounts decode_to_csv(const Dbc& dbc, std::istream& log, std::ostream& csv) {
  DecodeCounts counts;
  csv << "time_s,interface,identifier,message,signal,value,unit,name\n";
  CandumpRecord record;
  for (std::string line; std::getline(log, line);) {
    const CandumpLine kind = parse_candump_line(line, record);
    if (kind == CandumpLine::kComment) continue;
    if (kind != CandumpLine::kFrame) {
      ++counts.broken_lines;
      continue;
    }
    ++counts.frames;
    const CanFrame& frame = record.frame;
    const DbcMessage* message = dbc.find(frame.identifier, frame.has(CanFrame::kExtended));
    if (message == nullptr || frame.has(CanFrame::kError)) {
      ++counts.unknown;
    } else if (frame.has(CanFrame::kRemote) || !message->matches(frame)) {
      ++counts.wrong_format;
    } else {
      ++counts.decoded;
      write_frame(record, *message, csv);
    }
  }
  return counts;
}

std::string encode_text(const Dbc& dbc, const std::string& message_name,
                        const std::vector<std::string>& assignments,
                        std::vector<std::string>& remarks) {
  const DbcMessage& message = require_message(dbc, message_name);
  std::vector<DbcSignal> signals;
  std::vector<std::string> texts;
  std::set<std::string> given;
  for (const std::string& assignment : assignments) {
    const std::size_t equals = assignment.find('=');
    if (equals == std::string::npos)
      throw UsageError("'" + assignment + "': write a signal as NAME=VALUE");
    signals.push_back(require_signal(message, assignment.substr(0, equals)));
    texts.push_back(assignment.substr(equals + 1));
    const std::string& name = signals.back().name;
    if (!given.insert(name).second) throw UsageError(name + ": is given twice");
  }
  std::optional<CanFrame> frame = message.frame_for(signals);
  if (!frame) refuse_together(message, signals);
  for (std::size_t i = 0; i < signals.size(); ++i)
    write_value(signals[i], texts[i], {frame->data.data(), frame->num_bytes}, remarks);
  // A selector may have been given another value than the others need.
  for (const DbcSignal& signal : signals) {
    if (!message.carries(signal, frame->bytes())) refuse_together(message, signals);
  }
  const std::string line = format_candump_line({0, "x", *frame});
  return line.substr(line.rfind(' ') + 1);
}

}  // namespace holdfast
