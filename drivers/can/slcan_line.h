#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "drivers/can/can_frame.h"

namespace holdfast {

/// Appends the frame as a line of the SLCAN (Lawicel) protocol, carriage return included, FD frames
/// in the dialect of the CANable 2. False, and nothing appended, for an error frame. Precondition:
/// is_valid(frame).
bool append_slcan_line(const CanFrame& frame, std::string& text);

enum class SlcanLine {
  kFrame,
  kAcknowledged,  // an empty line, "z" or "Z"
  kRefused,       // the bell, which ends no line but stands for one
  kBusState,      // "s", then a, w, p or b, and counters: what the kernel's slcan reads, too
  kBusError,      // "e", then how many and which
  kAnswer,        // to a question about version, serial number or flags
  kBroken
};

/// Reads one line without its end. The frame is only changed for kFrame; a time stamp behind it is
/// left alone, since adapters count milliseconds from anywhere.
SlcanLine parse_slcan_line(std::string_view line, CanFrame& frame);

/// Cuts what comes from an adapter into lines, however it is split. A line that no adapter could
/// mean is given up at kBytesMax and told as broken.
class SlcanReader {
 public:
  static constexpr std::size_t kBytesMax = 160;

  using OnLine = std::function<void(SlcanLine, const CanFrame&, std::string_view)>;
  /// Calls on_line for each line that ends within the bytes, in order.
  void take(std::span<const char> bytes, const OnLine& on_line);
  /// Forgets the beginning of a line whose end will never come.
  void reset() {
    line_.clear();
    is_too_long_ = false;
  }

 private:
  void end_line(const OnLine& on_line);

  std::string line_;
  bool is_too_long_ = false;
};

}  // namespace holdfast
