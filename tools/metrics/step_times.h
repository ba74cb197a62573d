#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace holdfast {

/// Distribution of step times in buckets of 1/16 octave from 100 ns to 100 s: adds up exactly over
/// runs, whatever the order. A percentile is at most 2.2 % off.
struct TimeHistogram {
  static constexpr std::size_t kBucketsPerOctave = 16;
  // 30 octaves reach beyond 100 s. The first bucket takes what is shorter, the last what is longer.
  static constexpr std::size_t kNumBuckets = 30 * kBucketsPerOctave + 2;
  std::vector<std::int64_t> buckets = std::vector<std::int64_t>(kNumBuckets, 0);
  std::int64_t longest_ns = 0;

  void add(std::int64_t time_ns);  // below 0 counts as 0
  void add(const TimeHistogram& other);
  std::int64_t count() const;
  /// By nearest rank: the middle, on the log scale, of the bucket that holds the ceil(share
  /// count)-th shortest time, never above the longest; share 1 is the longest itself. NaN when
  /// empty. Precondition: 0 <= share <= 1.
  double percentile_ns(double share) const;
};

}  // namespace holdfast
