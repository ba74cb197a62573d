#pragma once

#include <cstdint>

namespace holdfast::testing {

/// Calls of operator new since the program began; linking this in replaces operator new.
std::int64_t allocation_count();

/// One more allocation, by other means than operator new (malloc_count.cpp).
void count_allocation();

}  // namespace holdfast::testing
