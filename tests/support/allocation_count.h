#pragma once

#include <cstdint>

namespace holdfast::testing {

/// Calls of operator new since the program began; linking this in replaces operator new.
std::int64_t allocation_count();

}  // namespace holdfast::testing
