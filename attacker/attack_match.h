#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "common/configuration.h"
#include "drivers/can/dbc.h"
#include "drivers/can/frame_codec.h"

namespace holdfast {

/// Identifier and width in one number: bit 29 tells 29-bit identifiers from 11-bit ones.
constexpr std::uint32_t frame_key(std::uint32_t identifier, bool is_extended) {
  return identifier | (is_extended ? 1U << 29 : 0U);
}

/// Bytes of a payload that a rule compares: (data[at + i] ^ value[i]) & mask[i] == 0 for all i.
struct PayloadMatch {
  int at = 0;                             // 0..63
  std::vector<std::uint8_t> value, mask;  // of one size

  /// False for a frame that is too short to hold them.
  bool matches(const CanFrame& frame) const;
};

/// Which frames a rule acts on; what is left out restricts nothing. The tick never matches.
struct AttackMatch {
  std::vector<std::string> nodes;           // senders in the DBC file; narrows `messages`
  std::vector<std::string> messages;        // by name: identifier and width of a DBC message
  std::vector<std::uint32_t> message_keys;  // frame_key() of each of them
  std::optional<std::uint32_t> identifier;  // (identifier ^ frame's) & mask == 0
  std::uint32_t mask = 0;
  bool is_extended = false;  // width that `identifier` speaks of
  enum class Type { kAny, kData, kRemote, kClassic, kFd };
  Type type = Type::kAny;
  PayloadMatch payload;  // empty when no comparison is asked
  std::string signal;    // "" when no comparison is asked
  double at_least = -std::numeric_limits<double>::infinity();
  double at_most = std::numeric_limits<double>::infinity();

  /// True when names, identifier and mask let this identifier through; signals and the tick are
  /// looked at by ProxyCore.
  bool matches_identifier(std::uint32_t frame_identifier, bool frame_is_extended) const;
  /// True when the frame is of the asked type and its payload compares equal.
  bool matches_content(const CanFrame& frame) const;
};

/// True when the rule, by name or identifier, speaks of this message; signals are not looked at.
bool selects(const AttackMatch& match, const DbcMessage& message);

/// The same, but never for the tick, and for the layout's command only when the rule names it.
bool can_select(const AttackMatch& match, const DbcMessage& message, const FrameLayout& layout);

/// Reads the map and returns the messages that it selects, never the tick; problems are reported on
/// the map.
std::vector<const DbcMessage*> read_match(ConfigurationMap map, AttackMatch& match,
                                          const FrameLayout& layout);

/// Reports, on the map's key, a signal that no frame of the match can carry. A message that was
/// named must have it; of those that merely fall under a mask, one is enough.
void check_signal(ConfigurationMap& map, const char* key, const std::string& signal,
                  const AttackMatch& match, const std::vector<const DbcMessage*>& selected);

/// Reports signals of which each is in some frame of the match, but all of them in none.
void check_together(ConfigurationMap& map, const char* key, const std::vector<std::string>& signals,
                    const std::vector<const DbcMessage*>& selected);

/// The message's signals of these names, in their order; none when it lacks one.
std::optional<std::vector<DbcSignal>> find_signals(const DbcMessage& message,
                                                   const std::vector<std::string>& names);

}  // namespace holdfast
