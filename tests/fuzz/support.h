#pragma once

#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/configuration.h"
#include "drivers/can/can_frame.h"
#include "drivers/can/frame_codec.h"

namespace holdfast::fuzzing {

/// A property that must hold whatever the input is: ends the program when it does not.
void must(bool holds);

inline std::string_view text_of(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

/// Takes an input apart; behind its end there are zeros.
class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : rest_(data, size) {}

  bool is_empty() const { return rest_.empty(); }
  std::span<const std::uint8_t> take_bytes(std::size_t size);
  template <class Number>
  Number take() {
    const std::span<const std::uint8_t> bytes = take_bytes(sizeof(Number));
    Number number{};
    if (!bytes.empty()) std::memcpy(&number, bytes.data(), bytes.size());
    return number;
  }
  /// A number below the limit, of one byte.
  std::size_t below(std::size_t limit) { return take<std::uint8_t>() % limit; }
  /// Any frame that a bus can deliver; no error frame.
  CanFrame take_frame();

 private:
  std::span<const std::uint8_t> rest_;
};

/// The layout in tests/fuzz/layouts/<name>.yaml.
FrameLayout layout_of(const std::string& name);

/// What a document of YAML text says of network frames; none when there is a problem.
std::optional<FrameLayout> read_layout(const std::string& text);

/// Frames of steps, from 1: one in several forms for each message, and the step's tick at last.
std::vector<std::vector<CanFrame>> frames_of_steps(const FrameLayout& layout,
                                                   std::size_t num_steps);

}  // namespace holdfast::fuzzing
