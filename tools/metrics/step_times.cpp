#include "tools/metrics/step_times.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace holdfast {
namespace {

constexpr double kShortestNs = 100.0;

std::size_t bucket_of(std::int64_t time_ns) {
  if (static_cast<double>(time_ns) < kShortestNs) return 0;
  const double octaves = std::log2(static_cast<double>(time_ns) / kShortestNs);
  const auto i = static_cast<std::size_t>(octaves * double{TimeHistogram::kBucketsPerOctave});
  return std::min(i + 1, TimeHistogram::kNumBuckets - 1);
}

}  // namespace

void TimeHistogram::add(std::int64_t time_ns) {
  ++buckets[bucket_of(time_ns)];
  longest_ns = std::max(longest_ns, time_ns);
}

void TimeHistogram::add(const TimeHistogram& other) {
  for (std::size_t i = 0; i < kNumBuckets; ++i) buckets[i] += other.buckets[i];
  longest_ns = std::max(longest_ns, other.longest_ns);
}

std::int64_t TimeHistogram::count() const {
  return std::accumulate(buckets.begin(), buckets.end(), std::int64_t{0});
}

double TimeHistogram::percentile_ns(double share) const {
  const std::int64_t total = count();
  if (total == 0) return std::numeric_limits<double>::quiet_NaN();
  const auto longest = static_cast<double>(longest_ns);
  const double exact = share * static_cast<double>(total);
  // 0.07 times 100 is a bit above 7 in binary numbers, and would count as the eighth.
  const auto rank = std::clamp(static_cast<std::int64_t>(std::ceil(exact * (1.0 - 1e-12))),
                               std::int64_t{1}, total);
  // The longest is known exactly, and what lies beyond the last bucket has no other value.
  if (rank == total) return longest;
  std::size_t i = 0;
  for (std::int64_t below = buckets[0]; below < rank; below += buckets[i]) ++i;
  if (i == 0) return std::min(0.5 * kShortestNs, longest);
  if (i == kNumBuckets - 1) return longest;
  const double middle =
      kShortestNs * std::exp2((static_cast<double>(i) - 0.5) / double{kBucketsPerOctave});
  return std::min(middle, longest);
}

}  // namespace holdfast
