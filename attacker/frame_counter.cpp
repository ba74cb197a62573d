#include "attacker/frame_counter.h"

namespace holdfast {

std::uint32_t ExtendedFrameCounter::next(std::uint32_t identifier, std::int64_t step) {
  std::size_t place = (identifier * 0x9E3779B1U) >> 16;
  for (std::size_t probe = 0; probe < kProbesMax; ++probe, place = (place + 1) % kNumSlots) {
    Slot& slot = slots_[place];
    if (slot.step == step && slot.identifier == identifier) return slot.count++;
    if (slot.step != step) {
      slot = {step, identifier, 1};
      return 0;
    }
  }
  // A flood of tens of thousands of identifiers in one step: these share a count rather than cost
  // memory.
  return slots_[place].count++;
}

}  // namespace holdfast
