#include "common/clock.h"

#include <ctime>

namespace holdfast {
namespace {

std::int64_t read_ns(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

}  // namespace

std::int64_t monotonic_time_ns() {
  return read_ns(CLOCK_MONOTONIC);
}

std::int64_t wall_utime() {
  return read_ns(CLOCK_REALTIME) / 1000;
}

}  // namespace holdfast
