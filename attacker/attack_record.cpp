#include "attacker/attack_record.h"

#include <array>

namespace holdfast {

const char* to_string(AttackRecord::Disposition disposition) {
  constexpr std::array<const char*, AttackRecord::kNumDispositions> kNames = {
      "altered", "dropped", "injected", "duplicated", "held", "released"};
  const auto index = static_cast<std::size_t>(disposition);
  return index < kNames.size() ? kNames[index] : "unknown";
}

}  // namespace holdfast
