#include "attacker/attack_record.h"

#include <array>

namespace holdfast {

const char* AttackRecord::name_of(Disposition disposition) {
  constexpr std::array<const char*, kNumDispositions> kNames = {
      "altered", "dropped", "injected", "duplicated", "held", "released"};
  const auto index = static_cast<std::size_t>(disposition);
  return index < kNames.size() ? kNames[index] : "unknown";
}

}  // namespace holdfast
