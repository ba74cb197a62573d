#include "common/measurement_set.h"

#include <array>

namespace holdfast {

const char* to_string(InvalidReason reason) {
  constexpr std::array<const char*, 6> kNames = {"valid",           "never_heard", "silent",
                                                 "not_operational", "error",       "not_available"};
  const auto index = static_cast<std::size_t>(reason);
  return index < kNames.size() ? kNames[index] : "unknown";
}

}  // namespace holdfast
