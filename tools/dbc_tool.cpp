#include "tools/dbc_tool.h"

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <istream>
#include <optional>
#include <ostream>
#include <set>

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

std::string multiplexing_text(const DbcSignal& signal) {
  if (signal.multiplexing == DbcSignal::Multiplexing::kSelector) return "selects";
  if (signal.multiplexing == DbcSignal::Multiplexing::kNone) return "";
  if (signal.selector_ranges.empty()) return "when " + std::to_string(signal.selector_value);
  std::string text;
  for (const auto& [first, last] : signal.selector_ranges) {
    text += (text.empty() ? "when " : ", ") + std::to_string(first);
    if (last != first) text += "-" + std::to_string(last);
  }
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

const std::string* name_of_value(const DbcSignal& signal, std::span<const std::uint8_t> data) {
  const auto found = signal.value_names.find(static_cast<std::int64_t>(signal.raw(data)));
  return found == signal.value_names.end() ? nullptr : &found->second;
}

void write_frame(const CandumpRecord& record, const DbcMessage& message, std::ostream& csv) {
  char time[40];
  std::snprintf(time, sizeof time, "%.6f", static_cast<double>(record.time_ns) * 1e-9);
  const CanFrame& frame = record.frame;
  for (const DbcSignal& signal : message.signals) {
    if (!message.carries(signal, frame.bytes())) continue;
    const std::string* name = name_of_value(signal, frame.bytes());
    csv << time << ',' << csv_text(record.interface_name) << ',' << identifier_text(frame) << ','
        << csv_text(message.name) << ',' << csv_text(signal.name) << ','
        << number_of(signal.unpack(frame.bytes())) << ',' << csv_text(signal.unit) << ','
        << (name == nullptr ? "" : csv_text(*name)) << '\n';
  }
}

double value_of(const DbcSignal& signal, const std::string& text) {
  double value = 0.0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (!text.empty() && error == std::errc{} && stop == end) return value;
  for (const auto& [raw, name] : signal.value_names) {
    if (name == text) return static_cast<double>(raw) * signal.scale + signal.offset;
  }
  throw UsageError(signal.name + ": '" + text + "' is neither a number nor a name of its values" +
                   (signal.value_names.empty() ? "" : ": " + names_text(signal)));
}

// A value of the selector for which all of the signals are in the frame; none when there is none.
std::optional<std::int64_t> selector_for(const std::vector<const DbcSignal*>& signals) {
  for (const DbcSignal* signal : signals) {
    std::vector<std::int64_t> values = {signal->selector_value};
    for (const auto& [first, last] : signal->selector_ranges) {
      values.push_back(first);
      values.push_back(last);
    }
    for (const std::int64_t value : values) {
      const bool selects_all = std::ranges::all_of(
          signals, [value](const DbcSignal* other) { return other->is_selected_by(value); });
      if (selects_all) return value;
    }
  }
  return std::nullopt;
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
                 printable(signal.unit, 40), multiplexing_text(signal),
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
                        const std::vector<std::string>& assignments) {
  const DbcMessage& message = require_message(dbc, message_name);
  CanFrame frame = message.empty_frame();
  const std::span<std::uint8_t> data(frame.data.data(), frame.num_bytes);
  std::vector<const DbcSignal*> selected;
  std::set<std::string> given;
  bool has_selector = false;
  for (const std::string& assignment : assignments) {
    const std::size_t equals = assignment.find('=');
    if (equals == std::string::npos)
      throw UsageError("'" + assignment + "': write a signal as NAME=VALUE");
    const DbcSignal& signal = require_signal(message, assignment.substr(0, equals));
    const std::string text = assignment.substr(equals + 1);
    if (!given.insert(signal.name).second) throw UsageError(signal.name + ": is given twice");
    if (!signal.pack(data, value_of(signal, text)))
      throw UsageError(signal.name + ": " + text + " does not fit its " +
                       std::to_string(signal.num_bits) + " bits");
    if (signal.multiplexing == DbcSignal::Multiplexing::kMultiplexed) selected.push_back(&signal);
    has_selector = has_selector || signal.multiplexing == DbcSignal::Multiplexing::kSelector;
  }
  if (!selected.empty() && message.selector() != nullptr) {
    const DbcSignal& selector = *message.selector();
    const auto value = has_selector
                           ? std::optional(static_cast<std::int64_t>(selector.raw(frame.bytes())))
                           : selector_for(selected);
    const bool is_good = value && std::ranges::all_of(selected, [&](const DbcSignal* signal) {
                           return signal->is_selected_by(*value);
                         });
    if (!is_good)
      throw UsageError("no frame of " + message_name + " carries all of these signals together");
    const double physical = static_cast<double>(*value) * selector.scale + selector.offset;
    if (!selector.pack(data, physical))
      throw UsageError(selector.name + ": " + std::to_string(*value) + " does not fit its " +
                       std::to_string(selector.num_bits) + " bits, so no frame carries " +
                       selected.front()->name);
  }
  const std::string line = format_candump_line({0, "x", frame});
  return line.substr(line.rfind(' ') + 1);
}

}  // namespace holdfast
