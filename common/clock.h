#pragma once

#include <cstdint>

namespace holdfast {

// The only place where a clock is read. Estimators, plants and attacks never call it: the time
// that they may use stands inside the messages.

/// Nanoseconds of CLOCK_MONOTONIC.
std::int64_t monotonic_time_ns();

/// Microseconds since 1970 of the wall clock, for time stamps that people read.
std::int64_t wall_utime();

}  // namespace holdfast
