#include "tools/metrics/step_times.h"

#include <cmath>

#include "tests/support/catch.h"

namespace holdfast {

TEST_CASE("a percentile of a step time is at most half a bucket off") {
  // Half of 1/16 octave: 2^(1/32) - 1; the times' rounding to whole ns adds 0.5 %.
  const double allowed = std::exp2(1.0 / 32.0) - 1.0 + 0.005;
  for (double time_ns = 100.0; time_ns < 1e11; time_ns *= 1.013) {
    TimeHistogram histogram;
    histogram.add(static_cast<std::int64_t>(time_ns));
    histogram.add(std::int64_t{200'000'000'000});  // so that the shorter one is not the longest
    CHECK(histogram.percentile_ns(0.5) == Approx(time_ns).epsilon(allowed));
  }
}

TEST_CASE("percentiles of step times are by nearest rank") {
  TimeHistogram histogram;
  for (std::int64_t i = 1000; i >= 1; --i) histogram.add(i * 1000);
  CHECK(histogram.count() == 1000);
  const double allowed = std::exp2(1.0 / 32.0) - 1.0;
  for (const int percent : {1, 7, 50, 90, 99}) {
    CHECK(histogram.percentile_ns(percent / 100.0) == Approx(percent * 10'000.0).epsilon(allowed));
  }
  CHECK(histogram.percentile_ns(1.0) == 1'000'000.0);  // exact
  TimeHistogram hundred;  // 0.07 times 100 is above 7 in binary numbers
  for (std::int64_t i = 1; i <= 100; ++i) hundred.add(i * 1000);
  CHECK(hundred.percentile_ns(0.07) == Approx(7'000.0).epsilon(allowed));
  TimeHistogram two;
  two.add(std::int64_t{1'000});
  two.add(std::int64_t{1'000'000});
  CHECK(two.percentile_ns(0.5) < 1'100.0);
  CHECK(two.percentile_ns(0.51) == 1'000'000.0);
}

TEST_CASE("step times outside the buckets are kept") {
  TimeHistogram histogram;
  CHECK(std::isnan(histogram.percentile_ns(0.5)));
  for (const std::int64_t time_ns : {-5LL, 0LL, 99LL, 300'000'000'000LL, 400'000'000'000LL})
    histogram.add(time_ns);
  CHECK(histogram.count() == 5);
  CHECK(histogram.percentile_ns(0.2) == 50.0);
  CHECK(histogram.percentile_ns(1.0) == 400e9);
  TimeHistogram shortest;
  shortest.add(std::int64_t{0});
  CHECK(shortest.percentile_ns(0.5) == 0.0);
}

TEST_CASE("step times add up to the same whatever the order") {
  TimeHistogram a, b, all;
  for (std::int64_t i = 1; i < 500; ++i) {
    const std::int64_t time_ns = i * i * i * 7;
    (i % 3 == 0 ? a : b).add(time_ns);
    all.add(time_ns);
  }
  TimeHistogram forward = a, backward = b;
  forward.add(b);
  backward.add(a);
  CHECK(forward.buckets == all.buckets);
  CHECK(backward.buckets == all.buckets);
  CHECK(forward.longest_ns == all.longest_ns);
  CHECK(backward.longest_ns == all.longest_ns);
  CHECK(a.buckets != all.buckets);
}

}  // namespace holdfast
