#pragma once

#include <optional>
#include <span>

#include "drivers/can/can_frame.h"

namespace holdfast {

/// Enough for every datagram of the format: 11 keys, 64 bytes of data, a channel name of 64.
inline constexpr std::size_t kUdpFrameBytesMax = 512;

/// Writes a frame as python-can's udp_multicast interface does: one msgpack map of 11 keys.
///
/// Returns the number of bytes, or 0 for a frame that is not valid or an error frame.
/// timestamp_s: seconds since 1970. Precondition: bytes.size() >= kUdpFrameBytesMax. No allocation.
std::size_t pack_udp_frame(const CanFrame& frame, double timestamp_s,
                           std::span<std::uint8_t> bytes);

/// Reads such a map under limits; no value when anything is not exactly so: a key that is missing,
/// double or unknown, a wrong type, a length that does not fit, bytes after the map. Never throws.
/// The sender's time stamp is not used.
std::optional<CanFrame> unpack_udp_frame(std::span<const std::uint8_t> bytes);

}  // namespace holdfast
