#include "attacker/attack_match.h"

#include <algorithm>
#include <set>

#include "drivers/can/hex_bytes.h"

namespace holdfast {
namespace {

constexpr std::uint32_t kStandardMask = 0x7FF;
constexpr std::uint32_t kExtendedMask = 0x1FFFFFFF;

using Messages = std::vector<const DbcMessage*>;

bool is_tick_message(const FrameLayout& layout, const DbcMessage& message) {
  const DbcMessage* tick = layout.dbc.find(layout.tick_message);
  return tick != nullptr && message.identifier == tick->identifier &&
         message.is_extended == tick->is_extended;
}

// Messages that the match names, or that fall under its identifier and mask.
Messages selected_messages(const AttackMatch& match, const FrameLayout& layout) {
  Messages selected;
  for (const DbcMessage& message : layout.dbc.messages) {
    if (can_select(match, message, layout)) selected.push_back(&message);
  }
  return selected;
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

// Narrows the match to messages that one of the nodes sends; a node is a sender in the DBC file.
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

void read_payload(ConfigurationMap map, PayloadMatch& payload) {
  const auto read_bytes = [&map](const char* key, std::vector<std::uint8_t>& bytes) {
    std::string text;
    map.read(key, text);
    const auto parsed = parse_hex_bytes(text);
    if (parsed && parsed->size() <= CanFrame::kBytesMax) {
      bytes = *parsed;
    } else if (map.has(key)) {
      map.problem(key, "'" + text + "' must be 1 to 64 bytes as pairs of hexadecimal digits");
    }
  };
  map.require("value");
  map.read("at", payload.at, {0.0, CanFrame::kBytesMax - 1.0});
  read_bytes("value", payload.value);
  payload.mask.assign(payload.value.size(), 0xFF);
  if (static_cast<std::size_t>(payload.at) + payload.value.size() > CanFrame::kBytesMax)
    map.problem("at", "lies so far back that no frame has all these bytes");
  if (!map.has("mask")) return;
  read_bytes("mask", payload.mask);
  if (payload.mask.size() != payload.value.size()) {
    map.problem("mask", "must have as many bytes as value");
    payload.mask.resize(payload.value.size(), 0xFF);
  }
}

}  // namespace

bool AttackMatch::matches_identifier(std::uint32_t frame_identifier, bool frame_is_extended) const {
  if (!messages.empty() &&
      std::find(message_keys.begin(), message_keys.end(),
                frame_key(frame_identifier, frame_is_extended)) == message_keys.end()) {
    return false;
  }
  if (!identifier) return true;
  return frame_is_extended == is_extended && ((frame_identifier ^ *identifier) & mask) == 0;
}

bool PayloadMatch::matches(const CanFrame& frame) const {
  const auto first = static_cast<std::size_t>(at);
  if (first + value.size() > frame.num_bytes) return false;
  for (std::size_t i = 0; i < value.size(); ++i) {
    if (((frame.data[first + i] ^ value[i]) & mask[i]) != 0) return false;
  }
  return true;
}

bool AttackMatch::matches_content(const CanFrame& frame) const {
  const bool is_remote = frame.has(CanFrame::kRemote), is_fd = frame.has(CanFrame::kFd);
  if ((type == Type::kData && is_remote) || (type == Type::kRemote && !is_remote) ||
      (type == Type::kClassic && is_fd) || (type == Type::kFd && !is_fd)) {
    return false;
  }
  return payload.value.empty() || (!is_remote && payload.matches(frame));
}

bool selects(const AttackMatch& match, const DbcMessage& message) {
  return match.matches_identifier(message.identifier, message.is_extended);
}

bool can_select(const AttackMatch& match, const DbcMessage& message, const FrameLayout& layout) {
  if (is_tick_message(layout, message) || !selects(match, message)) return false;
  return message.name != layout.command.message ||
         std::find(match.messages.begin(), match.messages.end(), message.name) !=
             match.messages.end();
}

Messages read_match(ConfigurationMap map, AttackMatch& match, const FrameLayout& layout) {
  read_message_names(map, match, layout);
  read_nodes(map, match, layout);
  read_identifier(map, match, layout);
  map.read_choice("type", match.type,
                  {{"any", AttackMatch::Type::kAny},
                   {"data", AttackMatch::Type::kData},
                   {"remote", AttackMatch::Type::kRemote},
                   {"classic", AttackMatch::Type::kClassic},
                   {"fd", AttackMatch::Type::kFd}});
  if (map.has("payload")) read_payload(map.map("payload"), match.payload);
  const Messages selected = selected_messages(match, layout);
  if (selected.empty() && !match.messages.empty() && match.identifier &&
      match.messages.size() == match.message_keys.size()) {
    map.problem("identifier", "is that of none of the messages: the rule could never act");
  }
  const bool has_bound = map.has("at_least") || map.has("at_most");
  if (map.has("signal") || has_bound) {
    map.read("signal", match.signal);
    map.read("at_least", match.at_least);
    map.read("at_most", match.at_most);
    check_signal(map, "signal", match.signal, match, selected);
    check_together(map, "signal", {match.signal}, selected);
    if (!has_bound) map.problem("signal", "needs at_least, at_most, or both");
    if (match.at_least > match.at_most) map.problem("at_most", "lies below at_least");
  }
  return selected;
}

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

void check_together(ConfigurationMap& map, const char* key, const std::vector<std::string>& signals,
                    const Messages& selected) {
  const DbcMessage* without = nullptr;
  for (const DbcMessage* message : selected) {
    const std::optional<std::vector<DbcSignal>> found = find_signals(*message, signals);
    if (!found) continue;
    if (message->frame_for(*found)) return;
    without = message;
  }
  if (without == nullptr) return;
  const std::string what = signals.size() == 1 ? "'" + signals.front() + "'" : "all of them";
  map.problem(key, "no frame of message '" + without->name + "' carries " + what);
}

std::optional<std::vector<DbcSignal>> find_signals(const DbcMessage& message,
                                                   const std::vector<std::string>& names) {
  std::vector<DbcSignal> found;
  for (const std::string& name : names) {
    const DbcSignal* signal = message.find(name);
    if (signal == nullptr) return std::nullopt;
    found.push_back(*signal);
  }
  return found;
}

}  // namespace holdfast
