#include "attacker/attack_rule.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace holdfast {
namespace {

constexpr Interval kFinite{std::numeric_limits<double>::lowest(),
                           std::numeric_limits<double>::max()};
constexpr Interval kFiniteNonNegative{0.0, std::numeric_limits<double>::max()};
constexpr std::uint32_t kStandardMask = 0x7FF;
constexpr std::uint32_t kExtendedMask = 0x1FFFFFFF;

using Messages = std::vector<const DbcMessage*>;

bool is_tick_message(const FrameLayout& layout, const DbcMessage& message) {
  return message.name == layout.tick_message;
}

/// Messages that the match names, or that fall under its identifier and mask; never the tick.
Messages selected_messages(const AttackMatch& match, const FrameLayout& layout) {
  Messages selected;
  for (const DbcMessage& message : layout.dbc.messages) {
    if (!is_tick_message(layout, message) && selects(match, message)) selected.push_back(&message);
  }
  return selected;
}

/// Reports a signal that no frame of the rule can carry. A message that was named must have it; of
/// those that merely fall under a mask, one is enough.
void check_signal(ConfigurationMap& map, const char* key, const std::string& signal,
                  const AttackMatch& match, const Messages& selected) {
  if (signal.empty()) {
    map.problem(key, "must name a signal");
    return;
  }
  const DbcMessage* without = nullptr;
  bool is_somewhere = false;
  for (const DbcMessage* message : selected) {
    if (message->find(signal) != nullptr) {
      is_somewhere = true;
    } else if (without == nullptr) {
      without = message;
    }
  }
  if (!match.messages.empty()) {
    if (without != nullptr) {
      map.problem(key, "message '" + without->name + "' has no signal '" + signal + "'");
    }
  } else if (!is_somewhere) {
    map.problem(key, "no message that the rule matches has a signal '" + signal + "'");
  }
}

void read_message_names(ConfigurationMap& map, AttackMatch& match, const FrameLayout& layout) {
  map.read("messages", match.messages);
  std::set<std::string> seen;
  for (const std::string& name : match.messages) {
    const DbcMessage* message = layout.dbc.find(name);
    if (name == layout.tick_message) {
      map.problem("messages", "no rule can match the tick ('" + name + "')");
    } else if (message == nullptr) {
      map.problem("messages", "the DBC file has no message '" + name + "'");
    } else {
      match.message_keys.push_back(frame_key(message->identifier, message->is_extended));
    }
    if (!seen.insert(name).second) map.problem("messages", "'" + name + "' given twice");
  }
}

/// Narrows the match to messages that one of the nodes sends; a node is a sender in the DBC file.
void read_nodes(ConfigurationMap& map, AttackMatch& match, const FrameLayout& layout) {
  map.read("nodes", match.nodes);
  if (match.nodes.empty()) return;
  for (const std::string& node : match.nodes) {
    const auto sends = [&node](const DbcMessage& message) { return message.sender == node; };
    if (std::none_of(layout.dbc.messages.begin(), layout.dbc.messages.end(), sends)) {
      map.problem("nodes", "no message of the DBC file is sent by '" + node + "'");
    }
  }
  const std::vector<std::string> named = std::move(match.messages);
  match.messages.clear();
  match.message_keys.clear();
  for (const DbcMessage& message : layout.dbc.messages) {
    const bool is_named =
        named.empty() || std::find(named.begin(), named.end(), message.name) != named.end();
    const bool is_sent =
        std::find(match.nodes.begin(), match.nodes.end(), message.sender) != match.nodes.end();
    if (!is_named || !is_sent || is_tick_message(layout, message)) continue;
    match.messages.push_back(message.name);
    match.message_keys.push_back(frame_key(message.identifier, message.is_extended));
  }
  if (match.messages.empty())
    map.problem("nodes", "send none of the messages that the rule could match");
}

void read_identifier(ConfigurationMap& map, AttackMatch& match, const FrameLayout& layout) {
  if (!map.has("identifier")) {
    for (const char* key : {"mask", "extended"}) {
      if (map.has(key)) map.problem(key, "needs the key identifier");
    }
    std::int64_t unused_mask = 0;
    bool unused_flag = false;
    // Read all the same, so that the keys are not called unknown on top.
    if (map.has("mask")) map.read("mask", unused_mask);
    if (map.has("extended")) map.read("extended", unused_flag);
    return;
  }
  map.read("extended", match.is_extended);
  const std::uint32_t full = match.is_extended ? kExtendedMask : kStandardMask;
  std::int64_t identifier = 0;
  std::int64_t mask = full;
  map.read("identifier", identifier, {0.0, static_cast<double>(full)});
  map.read("mask", mask, {0.0, static_cast<double>(full)});
  match.identifier = static_cast<std::uint32_t>(identifier);
  match.mask = static_cast<std::uint32_t>(mask);
  const DbcMessage* tick = layout.dbc.find(layout.tick_message);
  if (tick != nullptr && match.mask == full && tick->is_extended == match.is_extended &&
      tick->identifier == match.identifier) {
    map.problem("identifier", "no rule can match the tick ('" + tick->name + "')");
  }
}

/// Returns the messages that the match selects.
Messages read_match(ConfigurationMap map, AttackRule& rule, const FrameLayout& layout) {
  AttackMatch& match = rule.match;
  read_message_names(map, match, layout);
  read_nodes(map, match, layout);
  read_identifier(map, match, layout);
  const Messages selected = selected_messages(match, layout);
  const bool has_bound = map.has("at_least") || map.has("at_most");
  if (map.has("signal") || has_bound) {
    map.read("signal", match.signal);
    map.read("at_least", match.at_least);
    map.read("at_most", match.at_most);
    check_signal(map, "signal", match.signal, match, selected);
    if (!has_bound) map.problem("signal", "needs at_least, at_most, or both");
    if (match.at_least > match.at_most) map.problem("at_most", "lies below at_least");
    if (rule.action == AttackRule::Action::kInject) {
      map.problem("signal", "an injection compares nothing: there is no frame yet");
    }
  }
  return selected;
}

// Numbers of a distribution, one per signal; a single number in the file stands for all of them.
std::vector<double> read_numbers(ConfigurationMap& map, const char* key, std::size_t count,
                                 double fallback, Interval allowed) {
  std::vector<double> numbers(count, fallback);
  map.require(key);
  map.read_shared(key, numbers, count, allowed);
  numbers.resize(count, fallback);
  return numbers;
}

void read_replay(ConfigurationMap& map, ReplayDelay& replay) {
  map.require("delay_steps");
  std::vector<double> range = {1.0, 1.0};
  map.read("delay_steps", range, 2, {1.0, static_cast<double>(ReplayDelay::kMax)});
  if (range.size() != 2) return;
  if (range[0] > range[1] || range[0] != std::floor(range[0]) || range[1] != std::floor(range[1])) {
    map.problem("delay_steps", "must be [low, high], whole numbers of steps");
  }
  replay.low = static_cast<int>(range[0]);
  replay.high = static_cast<int>(range[1]);
}

void read_values(ConfigurationMap& rule_map, AttackRule& rule) {
  using Kind = ValueDistribution::Kind;
  rule_map.require("value");
  ConfigurationMap map = rule_map.map("value");
  Kind kind = Kind::kConstant;
  map.read_choice("distribution", kind,
                  {{"constant", Kind::kConstant},
                   {"uniform", Kind::kUniform},
                   {"normal", Kind::kNormal},
                   {"bernoulli", Kind::kBernoulli},
                   {"replay", Kind::kReplay}});
  const std::size_t count = rule.signals.size();
  rule.values.assign(count, {kind});
  if (!rule_map.has("value") || count == 0) return;
  const auto fill = [&](const char* key, double ValueDistribution::*field, Interval allowed) {
    const std::vector<double> numbers =
        read_numbers(map, key, count, ValueDistribution().*field, allowed);
    for (std::size_t i = 0; i < count; ++i) rule.values[i].*field = numbers[i];
  };
  switch (kind) {
    case Kind::kConstant:
      fill("value", &ValueDistribution::value, kAnyNumber);
      break;
    case Kind::kUniform:
      fill("low", &ValueDistribution::low, kFinite);
      fill("high", &ValueDistribution::high, kFinite);
      for (const ValueDistribution& value : rule.values) {
        if (value.low > value.high) return map.problem("high", "lies below low");
      }
      break;
    case Kind::kNormal:
      fill("mean", &ValueDistribution::mean, kFinite);
      fill("std", &ValueDistribution::std, kFiniteNonNegative);
      break;
    case Kind::kBernoulli:
      fill("probability", &ValueDistribution::probability, kProbability);
      break;
    case Kind::kReplay:
      read_replay(map, rule.replay);
      break;
  }
}

void read_count(ConfigurationMap map, CountDistribution& count) {
  using Kind = CountDistribution::Kind;
  map.read_choice("distribution", count.kind,
                  {{"constant", Kind::kConstant}, {"poisson", Kind::kPoisson}});
  map.read("mean", count.mean, {0.0, CountDistribution::kMax});
  if (count.kind == Kind::kConstant && count.mean != std::floor(count.mean)) {
    map.problem("mean", "a constant count must be a whole number");
  }
}

void read_flip(ConfigurationMap& map, AttackRule& rule, const Messages& selected) {
  const bool has_signal = map.has("signal");
  if (has_signal == map.has("bit")) {
    map.problem("action", "flip needs either signal or bit");
  }
  if (has_signal) {
    rule.signals.resize(1);
    map.read("signal", rule.signals[0]);
    check_signal(map, "signal", rule.signals[0], rule.match, selected);
  }
  if (!map.has("bit")) return;
  map.read("bit", rule.bit, {0.0, 8.0 * CanFrame::kBytesMax - 1.0});
  if (rule.match.messages.empty()) return;
  for (const DbcMessage* message : selected) {
    if (rule.bit >= 8 * message->num_bytes) {
      map.problem("bit", "message '" + message->name + "' has " +
                             std::to_string(8 * message->num_bytes) + " bits only");
    }
  }
}

void read_signals_and_values(ConfigurationMap& map, AttackRule& rule, const Messages& selected) {
  if (map.has("signals")) {
    map.read("signals", rule.signals);
    if (map.has("signal")) {
      std::string unused;
      map.read("signal", unused);
      map.problem("signal", "is one of signals: give either");
    }
    if (rule.signals.empty()) map.problem("signals", "must name a signal");
    if (rule.signals.size() > AttackRule::kSignalsMax) {
      map.problem("signals", "at most " + std::to_string(AttackRule::kSignalsMax));
    }
    if (std::set<std::string>(rule.signals.begin(), rule.signals.end()).size() !=
        rule.signals.size()) {
      map.problem("signals", "must name each signal once");
    }
  } else {
    rule.signals.resize(1);
    map.require("signal");
    map.read("signal", rule.signals[0]);
  }
  const char* key = map.has("signals") ? "signals" : "signal";
  if (map.has(key)) {
    for (const std::string& signal : rule.signals)
      check_signal(map, key, signal, rule.match, selected);
  }
  read_values(map, rule);
}

void read_inject(ConfigurationMap& map, AttackRule& rule, const FrameLayout& layout,
                 const Messages& selected) {
  read_signals_and_values(map, rule, selected);
  read_count(map.map("count"), rule.count);
  rule.counter_signal = layout.counter_signal;
  const bool is_own_counter = map.has("counter_signal");
  map.read("counter_signal", rule.counter_signal);
  if (is_own_counter && !rule.counter_signal.empty()) {
    check_signal(map, "counter_signal", rule.counter_signal, rule.match, selected);
  }
  map.read("counter_offset", rule.counter_offset, {-9.0e15, 9.0e15});
  if (selected.empty())
    map.problem("match", "an injection needs a message of the DBC file to forge");
}

AttackRule read_rule(ConfigurationMap map, const FrameLayout& layout) {
  using Action = AttackRule::Action;
  AttackRule rule;
  map.require("name");
  map.read("name", rule.name);
  map.require("action");
  map.read_choice("action", rule.action,
                  {{"drop", Action::kDrop},
                   {"flip", Action::kFlip},
                   {"substitute", Action::kSubstitute},
                   {"inject", Action::kInject}});
  const Messages selected = read_match(map.map("match"), rule, layout);
  rule.window.read(map.map("window"));
  map.read("probability", rule.probability, kProbability);
  map.read_choice("draw", rule.draw,
                  {{"frame", AttackRule::Draw::kFrame}, {"step", AttackRule::Draw::kStep}});
  switch (rule.action) {
    case Action::kDrop:
      break;
    case Action::kFlip:
      read_flip(map, rule, selected);
      break;
    case Action::kSubstitute:
      read_signals_and_values(map, rule, selected);
      break;
    case Action::kInject:
      read_inject(map, rule, layout, selected);
      break;
  }
  return rule;
}

}  // namespace

const char* to_string(AttackRule::Action action) {
  switch (action) {
    case AttackRule::Action::kDrop:
      return "drop";
    case AttackRule::Action::kFlip:
      return "flip";
    case AttackRule::Action::kSubstitute:
      return "substitute";
    case AttackRule::Action::kInject:
      return "inject";
  }
  return "unknown";
}

bool AttackMatch::matches_identifier(std::uint32_t frame_identifier, bool frame_is_extended) const {
  if (!messages.empty() &&
      std::find(message_keys.begin(), message_keys.end(),
                frame_key(frame_identifier, frame_is_extended)) == message_keys.end()) {
    return false;
  }
  if (!identifier) return true;
  return frame_is_extended == is_extended && ((frame_identifier ^ *identifier) & mask) == 0;
}

bool selects(const AttackMatch& match, const DbcMessage& message) {
  return match.matches_identifier(message.identifier, message.is_extended);
}

std::vector<AttackRule> read_attack_rules(ConfigurationMap parent, const FrameLayout& layout) {
  std::vector<AttackRule> rules;
  std::set<std::string> names;
  for (ConfigurationMap map : parent.maps("attacks")) {
    rules.push_back(read_rule(map, layout));
    const std::string& name = rules.back().name;
    if (map.has("name") && name.empty()) map.problem("name", "must not be empty");
    if (!name.empty() && !names.insert(name).second)
      map.problem("name", "'" + name + "' given twice");
  }
  return rules;
}

}  // namespace holdfast
