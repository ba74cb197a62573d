#include "common/pacer.h"

#include <poll.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "common/clock.h"
#include "common/errors.h"

namespace holdfast {
namespace {

constexpr double kPeriodMax_s = 1e9;  // keeps nanoseconds within 64 bits

}  // namespace

Pacer::Pacer(double period_s) {
  if (!(period_s > 0.0 && period_s < kPeriodMax_s)) {
    throw JobError("a pacer's period must be above 0 s, not " + std::to_string(period_s));
  }
  descriptor_ = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
  if (descriptor_ < 0) throw JobError("no timer descriptor is to be had from this kernel");
  const std::int64_t period_ns = std::max<std::int64_t>(1, std::llround(period_s * 1e9));
  const std::int64_t first_ns = monotonic_time_ns() + period_ns;
  const auto split = [](std::int64_t ns) {
    return timespec{static_cast<time_t>(ns / 1'000'000'000), static_cast<long>(ns % 1'000'000'000)};
  };
  const itimerspec schedule{split(period_ns), split(first_ns)};
  if (timerfd_settime(descriptor_, TFD_TIMER_ABSTIME, &schedule, nullptr) != 0) {
    close(descriptor_);
    throw JobError("the timer does not take a period of " + std::to_string(period_s) + " s");
  }
}

Pacer::~Pacer() {
  if (descriptor_ >= 0) close(descriptor_);
}

std::int64_t Pacer::acknowledge() {
  std::uint64_t expirations = 0;
  if (read(descriptor_, &expirations, sizeof expirations) != sizeof expirations) return 0;
  missed_ += static_cast<std::int64_t>(expirations) - 1;
  return static_cast<std::int64_t>(expirations);
}

void Pacer::wait() {
  while (acknowledge() == 0) {
    pollfd descriptor{descriptor_, POLLIN, 0};
    poll(&descriptor, 1, -1);
  }
}

}  // namespace holdfast
