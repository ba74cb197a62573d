#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

namespace holdfast {

/// One CAN or CAN FD frame as it stands on a bus.
struct CanFrame {
  enum Flag : std::uint8_t {
    kExtended = 1,  // 29-bit identifier
    kRemote = 2,
    kError = 4,  // made by the local controller, never sent on
    kFd = 8,
    kBitRateSwitch = 16,
    kErrorStateIndicator = 32
  };
  static constexpr std::size_t kBytesMax = 64;

  std::uint32_t identifier = 0;  // without flag bits
  std::uint8_t flags = 0;
  std::uint8_t num_bytes = 0;  // 0..8, or an FD length up to 64; of a remote frame: its request
  std::array<std::uint8_t, kBytesMax> data{};
  std::int64_t receive_time_ns = 0;  // wall clock, kernel's receive stamp; 0 when there was none

  bool has(Flag flag) const { return (flags & flag) != 0; }
  std::span<const std::uint8_t> bytes() const {
    return {data.data(), has(kRemote) ? 0U : num_bytes};
  }

  /// Same frame on the wire, whenever it arrived.
  bool same_on_wire(const CanFrame& other) const {
    return identifier == other.identifier && flags == other.flags && num_bytes == other.num_bytes &&
           std::equal(bytes().begin(), bytes().end(), other.bytes().begin());
  }
};

/// True when a classic (0..8) or FD length (0..8, 12, 16, 20, 24, 32, 48, 64) fits the flags and
/// the identifier fits its width.
bool is_valid(const CanFrame& frame);

/// Lengths that a frame can have, by its length code; of a classic one the first nine.
inline constexpr std::array<std::uint8_t, 16> kFrameLengths = {0, 1,  2,  3,  4,  5,  6,  7,
                                                               8, 12, 16, 20, 24, 32, 48, 64};

/// Smallest FD length of at least num_bytes; precondition: num_bytes <= 64.
std::uint8_t fd_length(std::size_t num_bytes);

}  // namespace holdfast
