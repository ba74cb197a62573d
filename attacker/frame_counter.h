#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace holdfast {

/// Counts the frames of each 29-bit identifier within a step, in fixed memory.
class ExtendedFrameCounter {
 public:
  /// Number of earlier frames of this identifier in this step. Precondition: steps never decrease.
  std::uint32_t next(std::uint32_t identifier, std::int64_t step);
  /// Must be called before next().
  void allocate() { slots_.resize(kNumSlots); }

 private:
  static constexpr std::size_t kNumSlots = 1U << 16;
  static constexpr std::size_t kProbesMax = 32;
  struct Slot {
    std::int64_t step = 0;
    std::uint32_t identifier = 0, count = 0;
  };
  std::vector<Slot> slots_;
};

}  // namespace holdfast
