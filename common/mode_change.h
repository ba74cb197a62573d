#pragma once

#include <cstdint>

namespace holdfast {

/// The plant's mode from a step on: planned, or ordered by a command to its breakers.
struct ModeChange {
  std::int64_t from_step = 1;
  int mode = 0;  // index among the plant's modes
};

/// What became of a command. kLate: it came when its step had begun and holds from the next one.
enum class CommandOutcome { kObeyed, kLate, kRefused };

}  // namespace holdfast
