#pragma once

#include <poll.h>

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "common/clock.h"
#include "drivers/can/can_bus.h"

namespace holdfast::testing {

/// Options of a bus that may write; a write fails when the bus is full for so long.
inline BusOptions writable(double timeout_s = BusOptions().write_timeout_s) {
  BusOptions options;
  options.may_write = true;
  options.write_timeout_s = timeout_s;
  return options;
}

/// Reads the bus, waiting on its descriptor, until the condition holds; false after the deadline.
/// on_frame takes each frame read.
inline bool read_until(CanBus& bus, const std::function<bool()>& condition,
                       const std::function<void(const CanFrame&)>& on_frame,
                       double timeout_s = 20.0) {
  const std::int64_t end_ns = monotonic_time_ns() + static_cast<std::int64_t>(timeout_s * 1e9);
  std::array<CanFrame, 64> batch;
  while (!condition()) {
    const std::size_t count = bus.read(batch);
    for (std::size_t i = 0; i < count; ++i) on_frame(batch[i]);
    if (count > 0 || condition()) continue;
    if (monotonic_time_ns() > end_ns) return false;
    pollfd wake{bus.file_descriptor(), POLLIN, 0};
    poll(&wake, 1, 100);
  }
  return true;
}

/// The next frames of the bus; fewer when they do not come in time.
inline std::vector<CanFrame> read_frames(CanBus& bus, std::size_t num, double timeout_s = 20.0) {
  std::vector<CanFrame> frames;
  read_until(
      bus, [&] { return frames.size() >= num; },
      [&](const CanFrame& frame) { frames.push_back(frame); }, timeout_s);
  return frames;
}

/// A frame whose data tell its number.
inline CanFrame numbered_frame(std::uint32_t number, std::uint32_t identifier = 0x123) {
  CanFrame frame;
  frame.identifier = identifier;
  frame.num_bytes = 4;
  for (std::size_t i = 0; i < 4; ++i) frame.data[i] = static_cast<std::uint8_t>(number >> (8 * i));
  return frame;
}

inline std::uint32_t number_of(const CanFrame& frame) {
  std::uint32_t number = 0;
  for (std::size_t i = 0; i < 4; ++i) number |= std::uint32_t{frame.data[i]} << (8 * i);
  return number;
}

/// Classic, extended, empty, remote and FD frames: one of each kind that a bus can carry.
inline std::vector<CanFrame> frames_of_every_kind() {
  const auto make = [](std::uint32_t identifier, int flags, int num_bytes) {
    CanFrame frame;
    frame.identifier = identifier;
    frame.flags = static_cast<std::uint8_t>(flags);
    frame.num_bytes = static_cast<std::uint8_t>(num_bytes);
    for (std::size_t i = 0; i < frame.bytes().size(); ++i) {
      frame.data[i] = static_cast<std::uint8_t>(0xF0 + 7 * i);
    }
    return frame;
  };
  return {make(0x123, 0, 8),
          make(0x7FF, 0, 0),
          make(0x123, CanFrame::kExtended, 3),  // a small identifier in the wide format
          make(0x1FFFFFFF, CanFrame::kExtended, 8),
          make(0x55, CanFrame::kRemote, 0),
          make(0x12345678, CanFrame::kRemote | CanFrame::kExtended, 5),
          make(0x321, CanFrame::kFd, 8),
          make(0x321, CanFrame::kFd | CanFrame::kBitRateSwitch, 12),
          make(0x1ABCDEF0, CanFrame::kFd | CanFrame::kExtended, 64)};
}

}  // namespace holdfast::testing
