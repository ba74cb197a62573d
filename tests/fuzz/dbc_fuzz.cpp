// libFuzzer target: whatever the bytes of a DBC file, every message that is kept makes a frame, and
// every signal that is kept lies inside it; and where a network of its messages is read without
// problems, the codec reads what it writes.

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <set>

#include "drivers/can/dbc.h"
#include "tests/fuzz/support.h"

namespace holdfast {
namespace {

using fuzzing::must;

void check_text(const std::string& text) {
  const std::string plain = utf8_text(text);
  must(plain.starts_with("\xEF\xBB\xBF") || utf8_text(plain) == plain);
  must(plain.size() <= 3 * text.size());
}

void check_signal(const DbcMessage& message, const DbcSignal& signal) {
  must(signal.fits(message.num_bytes));
  must(std::isfinite(signal.scale) && signal.scale != 0.0 && std::isfinite(signal.offset));
  CanFrame frame = message.empty_frame();
  const std::span<std::uint8_t> data(frame.data.data(), frame.num_bytes);
  const std::uint64_t ones = UINT64_MAX >> (64 - signal.num_bits);
  for (const std::uint64_t raw : {ones, 0x5555555555555555U & ones, std::uint64_t{1}}) {
    signal.set_raw(data, raw);
    must((signal.raw(frame.bytes()) & ones) == raw);
    signal.pack(data, signal.unpack(frame.bytes()));
  }
  signal.set_raw(data, 0);
  must(frame.data == CanFrame().data);
  for (const double value : {0.0, 1.0, -1e300, 1e300, std::nan("")}) signal.pack(data, value);
  message.carries(signal, frame.bytes());
}

void check_dbc(const Dbc& dbc) {
  std::set<std::pair<std::uint32_t, bool>> identifiers;
  std::set<std::string> names;
  for (const DbcMessage& message : dbc.messages) {
    must(identifiers.emplace(message.identifier, message.is_extended).second);
    must(names.insert(message.name).second);
    must(is_valid(message.empty_frame()) && message.matches(message.empty_frame()));
    for (const DbcSignal& signal : message.signals) check_signal(message, signal);
  }
  int line = 1;
  for (const DbcProblem& problem : dbc.problems) {
    must(problem.line >= line && problem.column >= 1 && !problem.text.empty());
    line = problem.line;
  }
}

// A network whose reading is the first message, with all of its signals that are not multiplexed
// otherwise, and whose tick is the second one.
void check_codec(const std::string& text, const Dbc& dbc) {
  if (!dbc.problems.empty() || dbc.messages.size() < 2 || dbc.messages[1].signals.empty()) return;
  YAML::Node network;
  network["dbc_text"] = text;
  network["messages"].push_back(dbc.messages[0].name);
  for (const DbcSignal& signal : dbc.messages[0].signals) network["signals"].push_back(signal.name);
  network["tick"]["message"] = dbc.messages[1].name;
  network["tick"]["signal"] = dbc.messages[1].signals[0].name;
  YAML::Emitter emitter;
  emitter << network;
  const std::optional<FrameLayout> layout = fuzzing::read_layout(emitter.c_str());
  if (!layout) return;
  const FrameCodec codec(*layout);
  std::vector<double> values(layout->signals.size(), 1.0);
  const CanFrame frame = codec.encode(0, values, 3);
  values.clear();
  const FrameCodec::Kind kind = codec.decode(frame, values).kind;
  must(kind == FrameCodec::Kind::kReading || kind == FrameCodec::Kind::kNonFinite);
  must(values.size() == (kind == FrameCodec::Kind::kReading ? layout->signals.size() : 0));
  must(codec.tick_matches(codec.decode(codec.encode_tick(3), values).tick_step, 3));
}

}  // namespace
}  // namespace holdfast

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(holdfast::fuzzing::text_of(data, size));
  holdfast::check_text(text);
  const holdfast::Dbc dbc = holdfast::parse_dbc(text);
  holdfast::check_dbc(dbc);
  holdfast::check_codec(text, dbc);
  return 0;
}
