#pragma once

#include <cstdint>

namespace holdfast::test {

/// Calls of operator new since the program began; the program's own operator new counts them.
std::int64_t allocation_count();

}  // namespace holdfast::test
