#include "drivers/radio_channel.h"

#include <algorithm>
#include <cmath>

#include "tests/support/catch.h"

namespace holdfast {
namespace {

struct Reading {
  int source;
  double bit;
};

MeasurementSet set_of(std::int64_t step, const std::vector<Reading>& readings) {
  MeasurementSet set;
  set.clear(step, step);
  for (const Reading& reading : readings) {
    Packet packet;
    packet.source = reading.source;
    set.add(packet, {&reading.bit, 1});
  }
  return set;
}

std::vector<double> heard(std::int64_t step, const std::vector<Reading>& readings,
                          std::uint64_t seed = 1, std::uint32_t run = 0, double gain = 2.0,
                          double noise_std = 0.5) {
  MeasurementSet set = set_of(step, readings);
  RadioChannel(gain, noise_std, seed, run).apply(set);
  return set.values;
}

TEST_CASE("without noise the radio only amplifies") {
  CHECK(heard(1, {{0, 1.0}, {3, 0.0}, {0, 1.0}}, 1, 0, 2.5, 0.0) ==
        std::vector<double>{2.5, 0.0, 2.5});
}

TEST_CASE("noise adds to gain times bit, whatever the bit is") {
  const auto zero = heard(4, {{2, 0.0}});
  const auto one = heard(4, {{2, 1.0}});
  CHECK(one[0] == 2.0 + zero[0]);
}

TEST_CASE("what one sensor's packets do shifts no other sensor's noise") {
  const auto all = heard(7, {{0, 1.0}, {1, 1.0}, {2, 0.0}});
  CHECK(heard(7, {{0, 1.0}, {2, 0.0}}) == std::vector<double>{all[0], all[2]});  // dropped
  CHECK(heard(7, {{2, 0.0}, {1, 1.0}, {0, 1.0}}) ==
        std::vector<double>{all[2], all[1], all[0]});  // reordered
  const auto injected = heard(7, {{0, 1.0}, {1, 1.0}, {1, 1.0}, {1, 0.0}, {2, 0.0}});
  CHECK(injected[0] == all[0]);
  CHECK(injected[1] == all[1]);
  CHECK(injected[4] == all[2]);
  CHECK(injected[1] != injected[2]);
}

TEST_CASE("the same arguments give the same noise on a used channel too") {
  RadioChannel radio(2.0, 0.5, 1, 0);
  MeasurementSet first = set_of(3, {{0, 1.0}, {1, 0.0}, {1, 0.0}});
  radio.apply(first);
  MeasurementSet between = set_of(4, {{5, 1.0}, {0, 0.0}});
  radio.apply(between);
  MeasurementSet again = set_of(3, {{0, 1.0}, {1, 0.0}, {1, 0.0}});
  radio.apply(again);
  CHECK(again.values == first.values);
  CHECK(heard(3, {{0, 1.0}, {1, 0.0}, {1, 0.0}}) == first.values);
  CHECK(heard(3, {{0, 1.0}}, 2) != heard(3, {{0, 1.0}}, 1));
  CHECK(heard(3, {{0, 1.0}}, 1, 1) != heard(3, {{0, 1.0}}, 1, 0));
  CHECK(heard(4, {{0, 1.0}}) != heard(3, {{0, 1.0}}));
}

TEST_CASE("each value of a packet has its own noise") {
  MeasurementSet set;
  set.clear(1, 0);
  set.add({}, std::vector<double>{1.0, 1.0, 1.0});
  RadioChannel(1.0, 1.0, 1, 0).apply(set);
  CHECK(set.values[0] != set.values[1]);
  CHECK(set.values[1] != set.values[2]);
}

TEST_CASE("noise has the mean and the variance that it should, over sources, packets and steps") {
  // 4 sources x 2 packets x 2500 steps = 20000 draws. Five standard errors: mean sigma/sqrt(N),
  // variance sigma^2 sqrt(2/N); chance of a false alarm below 1.2e-6 in all.
  const double sigma = 0.5;
  double sum = 0.0, sum_squares = 0.0;
  std::vector<double> seen;
  for (std::int64_t step = 1; step <= 2500; ++step) {
    for (const double y : heard(
             step, {{0, 0.0}, {1, 0.0}, {2, 0.0}, {3, 0.0}, {0, 0.0}, {1, 0.0}, {2, 0.0}, {3, 0.0}},
             1, 0, 2.0, sigma)) {
      sum += y;
      sum_squares += y * y;
      seen.push_back(y);
    }
  }
  const double count = static_cast<double>(seen.size());
  const double mean = sum / count;
  const double variance = sum_squares / count;
  const double allowed = 5.0 * sigma * sigma * std::sqrt(2.0 / count);
  CHECK(std::abs(mean) < 5.0 * sigma / std::sqrt(count));
  CHECK(std::abs(variance - sigma * sigma) < allowed);
  CHECK(std::abs(variance - 1.1 * sigma * sigma) >
        allowed);  // negative control: 10 % more would show
  // No draw is used twice.
  std::sort(seen.begin(), seen.end());
  CHECK(std::adjacent_find(seen.begin(), seen.end()) == seen.end());
}

}  // namespace
}  // namespace holdfast
