#include <algorithm>
#include <array>
#include <filesystem>
#include <optional>
#include <set>

#include "common/errors.h"
#include "drivers/can/frame_codec.h"

namespace holdfast {
namespace {

constexpr std::size_t kProblemsShown = 20;

template <class Items>
std::string names_of(const Items& items) {
  constexpr std::size_t kNamesShown = 24;
  std::string list;
  for (std::size_t i = 0; i < items.size() && i < kNamesShown; ++i) {
    list += (i == 0 ? "" : ", ") + items[i].name;
  }
  if (items.size() > kNamesShown) list += ", ...";
  return list.empty() ? "none" : list;
}

// Name of the DBC for messages; empty when there is no text to read.
std::string read_dbc_text(ConfigurationMap& map, const std::string& folder, std::string& text) {
  std::string file;
  const bool has_file = map.has("dbc");
  if (has_file && map.has("dbc_text")) map.problem("dbc", "give dbc or dbc_text, not both");
  if (!has_file && !map.has("dbc_text")) map.require("dbc");
  map.read("dbc", file);
  map.forget("dbc");
  map.read("dbc_text", text);
  if (!has_file) return map.has("dbc_text") ? "dbc_text" : "";
  if (file.empty() || !map.may_read_file("dbc")) return "";
  const std::filesystem::path path = std::filesystem::path(folder) / file;
  const std::optional<std::string> content = read_dbc_file(path.string());
  if (!content) {
    map.problem("dbc", path.string() + " cannot be read, or is empty");
    return "";
  }
  text = utf8_text(*content);
  map.resolve("dbc_text", YAML::Node(text));
  return path.string();
}

void report_dbc_problems(const Dbc& dbc, const std::string& name, ConfigurationMap& map) {
  const std::string key = name == "dbc_text" ? "dbc_text" : "dbc";
  for (std::size_t i = 0; i < dbc.problems.size() && i < kProblemsShown; ++i) {
    const DbcProblem& problem = dbc.problems[i];
    map.problem(key, name + ":" + std::to_string(problem.line) + ":" +
                         std::to_string(problem.column) + ": " + problem.text);
  }
  if (dbc.problems.size() > kProblemsShown) {
    map.problem(key, name + ": and " + std::to_string(dbc.problems.size() - kProblemsShown) +
                         " more problems");
  }
}

// Why the signal cannot count steps; empty when it can.
std::string counter_fault(const DbcSignal& signal) {
  if (signal.kind == DbcSignal::Kind::kUnsigned && signal.scale == 1.0 && signal.offset == 0.0)
    return "";
  return "'" + signal.name +
         "' must be an unsigned integer with scale 1 and offset 0 to count steps";
}

// Writing one of two overlapping signals would change the other, and writing into a checksum
// break it. Empty when none overlap.
std::string overlapping_signal(const std::vector<const DbcSignal*>& signals,
                               const FrameProtection* protection = nullptr) {
  std::array<std::uint8_t, CanFrame::kBytesMax> used{};
  if (protection != nullptr) {
    const std::vector<std::uint8_t> taken = protection->mask(used.size());
    std::copy(taken.begin(), taken.end(), used.begin());
  }
  for (const DbcSignal* signal : signals) {
    std::array<std::uint8_t, CanFrame::kBytesMax> bits{};
    signal->set_raw(bits, ~std::uint64_t{0});
    for (std::size_t i = 0; i < bits.size(); ++i) {
      if ((used[i] & bits[i]) != 0) return signal->name;
      used[i] = static_cast<std::uint8_t>(used[i] | bits[i]);
    }
  }
  return "";
}

class LayoutCheck {
 public:
  LayoutCheck(const FrameLayout& layout, ConfigurationMap& map) : layout_(layout), map_(map) {}

  void check_tick(ConfigurationMap tick) {
    const DbcMessage* message = layout_.dbc.find(layout_.tick_message);
    if (message == nullptr) {
      is_good_ = false;
      tick.problem("message", "'" + layout_.tick_message + "' is no message of the DBC; it has " +
                                  names_of(layout_.dbc.messages));
      return;
    }
    const DbcSignal* signal = message->find(layout_.tick_signal);
    const std::string fault =
        signal == nullptr ? no_signal(*message, layout_.tick_signal) : counter_fault(*signal);
    if (fault.empty()) return;
    is_good_ = false;
    tick.problem("signal", fault);
  }

  void check_messages() {
    std::set<std::string> seen;
    for (const std::string& name : layout_.messages) {
      const DbcMessage* message = layout_.dbc.find(name);
      if (message == nullptr) {
        problem("messages", "'" + name + "' is no message of the DBC; it has " +
                                names_of(layout_.dbc.messages));
      } else if (!seen.insert(name).second) {
        problem("messages", "'" + name + "' is given twice");
      } else if (name == layout_.tick_message) {
        problem("messages", "'" + name + "' is the tick, which carries no reading");
      } else {
        check_signals(*message);
      }
    }
  }

  void check_command(ConfigurationMap map) {
    const CommandLayout& command = layout_.command;
    const DbcMessage* message = layout_.dbc.find(command.message);
    if (message == nullptr) {
      map.problem("message", "'" + command.message + "' is no message of the DBC; it has " +
                                 names_of(layout_.dbc.messages));
      return;
    }
    if (command.message == layout_.tick_message ||
        std::find(layout_.messages.begin(), layout_.messages.end(), command.message) !=
            layout_.messages.end()) {
      map.problem("message", "'" + command.message + "' is a reading or the tick already");
    }
    std::vector<const DbcSignal*> used;
    check_command_signal(*message, map, "mode", command.mode_signal, 16, used);
    check_command_signal(*message, map, "step", command.step_signal, 32, used);
    const std::string overlapping = overlapping_signal(used);
    if (!overlapping.empty())
      map.problem("step", "'" + overlapping + "' shares bits with the mode's");
  }

  // What is left can only be told by making a codec: whether one frame can carry all the signals.
  void check_codec() {
    if (!is_good_ || layout_.messages.empty()) return;
    try {
      const FrameCodec codec(layout_);
    } catch (const UsageError& error) {
      problem("signals", error.what());
    }
  }

 private:
  static std::string no_signal(const DbcMessage& message, const std::string& name) {
    return "message '" + message.name + "' has no signal '" + name + "'; it has " +
           names_of(message.signals);
  }
  void problem(const char* key, const std::string& text) {
    is_good_ = false;
    map_.problem(key, text);
  }

  static void check_command_signal(const DbcMessage& message, ConfigurationMap& map,
                                   const char* key, const std::string& name, int bits_max,
                                   std::vector<const DbcSignal*>& used) {
    const DbcSignal* signal = message.find(name);
    if (signal == nullptr) return map.problem(key, no_signal(message, name));
    used.push_back(signal);
    const bool is_plain = signal->kind == DbcSignal::Kind::kUnsigned && signal->scale == 1.0 &&
                          signal->offset == 0.0 && signal->num_bits <= bits_max &&
                          !signal->is_selector && !signal->is_multiplexed();
    if (is_plain) return;
    map.problem(key, "'" + name + "' must be an unsigned integer of at most " +
                         std::to_string(bits_max) +
                         " bits with scale 1 and offset 0, not multiplexed");
  }

  void check_signals(const DbcMessage& message) {
    std::vector<const DbcSignal*> used;
    for (const std::string& name : layout_.signals) {
      const DbcSignal* signal = message.find(name);
      if (signal == nullptr) {
        problem("signals", no_signal(message, name));
      } else {
        used.push_back(signal);
      }
    }
    if (!layout_.counter_signal.empty()) {
      const DbcSignal* counter = message.find(layout_.counter_signal);
      if (counter == nullptr) {
        problem("counter_signal", no_signal(message, layout_.counter_signal));
      } else {
        check_counter(message, *counter);
        used.push_back(counter);
      }
    }
    for (std::size_t i = 0; i < used.size(); ++i) {  // it grows
      const DbcSignal* selector = message.selector_of(*used[i]);
      if (selector != nullptr && std::ranges::find(used, selector) == used.end())
        used.push_back(selector);
    }
    const std::string overlapping = overlapping_signal(used, layout_.find_protection(message.name));
    if (overlapping.empty()) return;
    problem("signals", "'" + overlapping + "' of message '" + message.name +
                           "' shares bits with another signal in use, or with its protection");
  }

  void check_counter(const DbcMessage& message, const DbcSignal& counter) {
    const std::string fault = counter_fault(counter);
    if (!fault.empty()) problem("counter_signal", fault + " (message '" + message.name + "')");
    if (counter_bits_ == 0) counter_bits_ = counter.num_bits;
    if (counter.num_bits == counter_bits_) return;
    problem("counter_signal", "has " + std::to_string(counter.num_bits) + " bits in message '" +
                                  message.name + "', " + std::to_string(counter_bits_) +
                                  " in others");
  }

  const FrameLayout& layout_;
  ConfigurationMap& map_;
  bool is_good_ = true;
  int counter_bits_ = 0;
};

// Sensors say what they send by themselves.
void refuse_message_keys(ConfigurationMap& map) {
  for (const char* key : {"messages", "signals", "counter_signal", "protection"}) {
    if (!map.has(key)) continue;
    map.problem(key, "stands in place of sensors: give either");
    map.raw(key);
  }
}

// Neither the tick nor a command may be one of their frames.
void check_sensors(const FrameLayout& layout, ConfigurationMap& map) {
  for (const std::string& name : {layout.tick_message, layout.command.message}) {
    const DbcMessage* message = layout.dbc.find(name);
    const std::string sensor =
        message == nullptr ? "" : sensor_on(layout.sensors, layout.dbc, *message);
    if (!sensor.empty())
      map.problem("sensors", "'" + sensor + "' has the identifier of message '" + name + "'");
  }
}

}  // namespace

const FrameProtection* FrameLayout::find_protection(const std::string& message) const {
  for (const FrameProtection& it : protection) {
    if (it.message == message) return &it;
  }
  return nullptr;
}

void FrameLayout::read(ConfigurationMap map, const std::string& folder) {
  std::string text;
  const std::string name = read_dbc_text(map, folder, text);
  const bool has_sensors = map.has("sensors");
  if (has_sensors) {
    refuse_message_keys(map);
  } else {
    map.require("messages");
    map.read("messages", messages);
    map.require("signals");
    map.read("signals", signals);
    map.read("counter_signal", counter_signal);
  }
  ConfigurationMap tick = map.map("tick");
  tick.read("message", tick_message);
  tick.read("signal", tick_signal);
  if (map.has("command")) {
    ConfigurationMap command_map = map.map("command");
    command_map.require("message");
    command_map.read("message", command.message);
    if (command_map.has("message") && command.message.empty())
      command_map.problem("message", "must not be empty; leave command out where there is none");
    command_map.read("mode", command.mode_signal);
    command_map.read("step", command.step_signal);
  }
  if (map.has("messages") && messages.empty())
    map.problem("messages", "at least one message is needed");
  if (map.has("signals") && signals.empty())
    map.problem("signals", "at least one signal is needed");
  if (name.empty()) {
    if (has_sensors) map.raw("sensors");
    map.raw("protection");
    return;
  }
  dbc = parse_dbc(text);
  if (has_sensors) {
    sensors.read(map, dbc);
    signals = {"STATE"};
    for (const BinarySensor& sensor : sensors.list) messages.push_back(sensor.name);
  }
  if (!has_sensors) protection = read_protection(map, dbc, messages);
  report_dbc_problems(dbc, name, map);
  LayoutCheck check(*this, map);
  check.check_tick(tick);
  if (!has_sensors) check.check_messages();
  if (has_sensors) check_sensors(*this, map);
  if (command.exists()) check.check_command(map.map("command"));
  check.check_codec();
}

}  // namespace holdfast
