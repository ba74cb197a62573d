#pragma once

#include <cstdint>

namespace holdfast {

/// Absolute deadlines on CLOCK_MONOTONIC by timerfd: work time and late wake-ups never add up.
class Pacer {
 public:
  /// First deadline one period from now. Throws JobError without timerfd, or when the period is
  /// not above 0.
  explicit Pacer(double period_s);
  ~Pacer();
  Pacer(const Pacer&) = delete;
  Pacer& operator=(const Pacer&) = delete;

  /// Readable when a deadline has passed; call acknowledge() then.
  int file_descriptor() const { return descriptor_; }
  /// Consumes what has expired; returns the number of deadlines (0 when none), more than 1 when
  /// some were missed. Missed ones are counted and skipped, never made up for in a burst.
  std::int64_t acknowledge();
  /// Waits for the next deadline.
  void wait();
  std::int64_t missed() const { return missed_; }

 private:
  int descriptor_ = -1;
  std::int64_t missed_ = 0;
};

}  // namespace holdfast
