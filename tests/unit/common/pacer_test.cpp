#include "common/pacer.h"

#include <poll.h>

#include <limits>

#include "common/clock.h"
#include "common/errors.h"
#include "tests/support/catch.h"

namespace holdfast {

TEST_CASE("deadlines stay on one grid, however long the work between them takes") {
  constexpr std::int64_t kPeriodNs = 2'000'000;
  const std::int64_t created_after_ns = monotonic_time_ns();
  Pacer pacer(kPeriodNs * 1e-9);
  const std::int64_t created_before_ns = monotonic_time_ns();
  Pacer work(kPeriodNs * 0.7e-9);
  std::int64_t num_waits = 0;
  std::int64_t last_wait_began_ns = 0;
  while (num_waits < 40) {
    work.wait();
    last_wait_began_ns = monotonic_time_ns();
    pacer.wait();
    ++num_waits;
  }
  const std::int64_t ended_ns = monotonic_time_ns();
  // Deadline n stands n periods after the creation: work that added up would leave too few of them.
  const std::int64_t num_deadlines = num_waits + pacer.missed();
  CHECK(num_deadlines * kPeriodNs <= ended_ns - created_after_ns);
  CHECK((num_deadlines + 1) * kPeriodNs > last_wait_began_ns - created_before_ns);
}

TEST_CASE("missed deadlines are counted and never made up for") {
  Pacer pacer(0.004);
  Pacer late(0.022);
  late.wait();
  const std::int64_t num_expired = pacer.acknowledge();
  CHECK(num_expired >= 5);
  CHECK(pacer.missed() == num_expired - 1);
  CHECK(pacer.acknowledge() <= 1);
}

TEST_CASE("the descriptor is readable when a deadline has passed, and only then") {
  Pacer pacer(3600.0);
  pollfd far{pacer.file_descriptor(), POLLIN, 0};
  CHECK(poll(&far, 1, 0) == 0);
  CHECK(pacer.acknowledge() == 0);
  Pacer soon(0.001);
  pollfd near{soon.file_descriptor(), POLLIN, 0};
  CHECK(poll(&near, 1, 5000) == 1);
  CHECK(soon.acknowledge() >= 1);
  CHECK(pacer.missed() == 0);
}

TEST_CASE("a period that is none is refused") {
  for (const double period_s : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(),
                                std::numeric_limits<double>::infinity()}) {
    CHECK_THROWS_AS(Pacer(period_s), JobError);
  }
}

}  // namespace holdfast
