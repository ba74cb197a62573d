#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "common/configuration.h"
#include "drivers/can/dbc.h"

namespace holdfast {

/// How the receivers of a message check it: a checksum, of AUTOSAR's profiles a counter too.
///
///   xor         one byte: XOR of all other bytes
///   crc8_j1850  one byte: CRC-8 SAE J1850 of all other bytes
///   e2e_p1      E2E profile 1, variant A. Byte 0: CRC-8 SAE J1850, start 0 and not inverted, of
///               the data id (low byte first) and all other bytes. Low nibble of byte 1: counter,
///               0 to 14
///   e2e_p2      E2E profile 2. Byte 0: CRC-8H2F of all other bytes and data_ids[counter]. Low
///               nibble of byte 1: counter, 0 to 15
///   e2e_p5      E2E profile 5. Two bytes, low one first: CRC-16 CCITT-FALSE of all other bytes and
///               the data id (low byte first). Then a byte with the counter
/// Profiles as in AUTOSAR's PRS E2E protocol specification.
struct FrameProtection {
  enum class Kind { kXor, kCrc8J1850, kE2eProfile1, kE2eProfile2, kE2eProfile5 };

  std::string message;
  Kind kind = Kind::kXor;
  int checksum_at = 0;                 // byte; 0 for profiles 1 and 2
  int data_id = 0;                     // profiles 1 and 5
  std::vector<std::uint8_t> data_ids;  // profile 2: 16 of them

  /// Sets the profile's counter to what a step has; nothing where there is none. Precondition for
  /// all: the data has the message's length.
  void set_counter(std::span<std::uint8_t> data, std::int64_t step) const;
  /// Writes the checksum of what the data holds.
  void seal(std::span<std::uint8_t> data) const;
  /// True when the checksum is that of the data.
  bool is_sound(std::span<const std::uint8_t> data) const;
  /// Bytes that are not free for signals; of byte 1 of profiles 1 and 2, the low nibble.
  std::vector<std::uint8_t> mask(std::size_t num_bytes) const;

 private:
  std::size_t checksum_bytes() const { return kind == Kind::kE2eProfile5 ? 2 : 1; }
  unsigned checksum(std::span<const std::uint8_t> data) const;
};

/// Entries below the list key `protection` of the map. Every problem is reported on it.
///
/// readings: the messages that may be protected.
std::vector<FrameProtection> read_protection(ConfigurationMap& map, const Dbc& dbc,
                                             const std::vector<std::string>& readings);

}  // namespace holdfast
