#include "common/random_stream.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <set>
#include <vector>

#include "tests/support/catch.h"

namespace holdfast {
namespace {

using Words = std::array<std::uint32_t, 4>;

// A second Philox4x32-10, written from the paper's definition, to check the library's by.
Words philox(Words counter, std::array<std::uint32_t, 2> key) {
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t a = std::uint64_t{0xD2511F53} * counter[0];
    const std::uint64_t b = std::uint64_t{0xCD9E8D57} * counter[2];
    counter = {
        static_cast<std::uint32_t>(b >> 32) ^ counter[1] ^ key[0], static_cast<std::uint32_t>(b),
        static_cast<std::uint32_t>(a >> 32) ^ counter[3] ^ key[1], static_cast<std::uint32_t>(a)};
    key[0] += 0x9E3779B9;
    key[1] += 0xBB67AE85;
  }
  return counter;
}

// Largest distance of the empirical distribution from a continuous one, times sqrt(n).
double kolmogorov_smirnov(std::vector<double> sample,
                          const std::function<double(double)>& distribution) {
  std::sort(sample.begin(), sample.end());
  const double n = static_cast<double>(sample.size());
  double distance = 0.0;
  for (std::size_t i = 0; i < sample.size(); ++i) {
    const double expected = distribution(sample[i]);
    const double rank = static_cast<double>(i);
    distance = std::max({distance, expected - rank / n, (rank + 1.0) / n - expected});
  }
  return std::sqrt(n) * distance;
}

// Kolmogorov's distribution has 1e-4 above this: 2 exp(-2 x^2) = 1e-4.
constexpr double kKolmogorovBound = 2.2253;
constexpr std::size_t kNumDraws = 100'000;

std::vector<double> draws(const std::function<double(std::uint32_t, std::uint64_t)>& draw) {
  std::vector<double> sample(kNumDraws);
  // 100 steps of 1000 draws each, so that both addresses are exercised.
  for (std::size_t i = 0; i < kNumDraws; ++i)
    sample[i] = draw(static_cast<std::uint32_t>(i / 1000), i % 1000);
  return sample;
}

double normal_distribution(double x) {
  return 0.5 * std::erfc(-x / std::sqrt(2.0));
}

// Pearson's statistic against Poisson(mean) over the counts 0..last-1 and "last or more".
double poisson_chi_square(const std::vector<double>& sample, double mean, int last) {
  std::vector<double> observed(static_cast<std::size_t>(last) + 1);
  for (const double count : sample)
    observed[static_cast<std::size_t>(std::min<int>(static_cast<int>(count), last))] += 1;
  double statistic = 0.0, probability = std::exp(-mean), left = 1.0;
  for (int count = 0; count <= last; ++count) {
    const double expected =
        static_cast<double>(sample.size()) * (count == last ? left : probability);
    const double difference = observed[static_cast<std::size_t>(count)] - expected;
    statistic += difference * difference / expected;
    left -= probability;
    probability *= mean / (count + 1);
  }
  return statistic;
}

double correlation(const std::vector<double>& x, const std::vector<double>& y) {
  double xy = 0.0, xx = 0.0, yy = 0.0;
  for (std::size_t i = 0; i < std::min(x.size(), y.size()); ++i) {
    xy += x[i] * y[i];
    xx += x[i] * x[i];
    yy += y[i] * y[i];
  }
  return xy / std::sqrt(xx * yy);
}

}  // namespace

TEST_CASE("the generator is Philox4x32-10: published vectors, then the stream against them") {
  CHECK(philox({0, 0, 0, 0}, {0, 0}) == Words{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8});
  CHECK(philox({0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff}, {0xffffffff, 0xffffffff}) ==
        Words{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd});
  CHECK(philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}) ==
        Words{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1});

  const RandomStream stream(42, 3, "test");
  const auto key = stream.key();
  for (const std::uint64_t block :
       {std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{5'000'000'000}}) {
    for (const std::uint32_t step : {0U, 1U, 77U}) {
      const Words words = philox(
          {static_cast<std::uint32_t>(block), static_cast<std::uint32_t>(block >> 32), step, 3},
          {static_cast<std::uint32_t>(key), static_cast<std::uint32_t>(key >> 32)});
      const auto unit = [](std::uint32_t high, std::uint32_t low) {
        return (std::ldexp(high, 20) + std::floor(std::ldexp(low, -12)) + 0.5) *
               std::ldexp(1.0, -52);
      };
      CHECK(stream.uniform(step, 2 * block) == unit(words[0], words[1]));
      CHECK(stream.uniform(step, 2 * block + 1) == unit(words[2], words[3]));
    }
  }
}

TEST_CASE("a stream's numbers stay what they were") {
  // Logs and reports of earlier versions can only be repeated while these hold.
  CHECK(stable_hash("") == 0xcbf29ce484222325U);
  CHECK(stable_hash("foobar") == 0x85944171f73967e8U);
  const RandomStream stream(1, 0, "frozen");
  CHECK(stream.key() == 0x5025ab11577756edU);
  CHECK(stream.uniform(1, 0) == 0x1.750931316a12dp-1);
}

TEST_CASE("uniform draws are uniform on the open interval") {
  const RandomStream stream(1, 0, "uniform");
  const auto sample = draws([&](auto step, auto draw) { return stream.uniform(step, draw); });
  CHECK(*std::min_element(sample.begin(), sample.end()) > 0.0);
  CHECK(*std::max_element(sample.begin(), sample.end()) < 1.0);
  CHECK(kolmogorov_smirnov(sample, [](double x) { return x; }) < kKolmogorovBound);
  // Negative control: a distribution that is off by at most 0.018.
  CHECK(kolmogorov_smirnov(sample, [](double x) { return std::pow(x, 1.05); }) > kKolmogorovBound);
}

TEST_CASE("normal draws are standard normal") {
  const RandomStream stream(1, 0, "normal");
  const auto sample = draws([&](auto step, auto draw) { return stream.normal(step, draw); });
  CHECK(kolmogorov_smirnov(sample, normal_distribution) < kKolmogorovBound);
  CHECK(kolmogorov_smirnov(sample, [](double x) { return normal_distribution(x / 1.05); }) >
        kKolmogorovBound);
  // Box-Muller's two values share a block; each looks normal, and together they must be
  // independent.
  std::vector<double> next(sample.begin() + 1, sample.end());
  CHECK(std::abs(correlation(sample, next)) < 4.0 / std::sqrt(static_cast<double>(kNumDraws)));
  CHECK(std::abs(correlation(sample, sample)) > 0.99);
}

TEST_CASE("poisson draws have their distribution") {
  const RandomStream stream(1, 0, "poisson");
  const auto sample = draws(
      [&](auto step, auto draw) { return static_cast<double>(stream.poisson(5.0, step, draw)); });
  // 15 cells, so 14 degrees of freedom; chi-square has 1e-4 above 42.58 (Wilson-Hilferty within
  // 0.1).
  CHECK(poisson_chi_square(sample, 5.0, 14) < 42.7);
  CHECK(poisson_chi_square(sample, 5.1, 14) > 42.7);
  CHECK(stream.poisson(0.0, 1, 0) == 0);
  // The largest mean allowed: within 8 standard deviations, so neither the start nor the end is
  // cut.
  for (std::uint64_t draw = 0; draw < 1000; ++draw) {
    CHECK(std::abs(stream.poisson(500.0, 1, draw) - 500) < 8.0 * std::sqrt(500.0));
  }
}

TEST_CASE("streams, runs, steps and draws do not share numbers") {
  std::set<double> seen;
  int num_draws = 0;
  for (const char* name : {"a", "b", "ab", ""}) {
    for (const std::uint64_t seed : {0, 1, 2, 3}) {
      for (const std::uint32_t run : {0U, 1U}) {
        const RandomStream stream(seed, run, name);
        for (const std::uint32_t step : {0U, 1U, 2U}) {
          for (std::uint64_t draw = 0; draw < 4; ++draw) {
            seen.insert(stream.uniform(step, draw));
            ++num_draws;
          }
        }
      }
    }
  }
  // 384 draws of 52 bits meet by chance with probability below 2e-11.
  CHECK(static_cast<int>(seen.size()) == num_draws);
}

TEST_CASE("streams, runs and steps are uncorrelated") {
  const auto centred = [](const RandomStream& stream, std::uint32_t first_step) {
    return draws(
        [&](auto step, auto draw) { return stream.uniform(step + first_step, draw) - 0.5; });
  };
  const auto base = centred(RandomStream(1, 0, "a"), 0);
  // A sample correlation of n independent pairs has standard deviation 1/sqrt(n); 4 of them: 6e-5.
  const double bound = 4.0 / std::sqrt(static_cast<double>(kNumDraws));
  CHECK(std::abs(correlation(base, centred(RandomStream(2, 0, "a"), 0))) < bound);
  CHECK(std::abs(correlation(base, centred(RandomStream(1, 1, "a"), 0))) < bound);
  CHECK(std::abs(correlation(base, centred(RandomStream(1, 0, "b"), 0))) < bound);
  CHECK(std::abs(correlation(base, centred(RandomStream(1, 0, "a"), 1))) < bound);
  CHECK(std::abs(correlation(base, centred(RandomStream(1, 0, "a"), 0))) > bound);
}

TEST_CASE("a pair of draws is the two that are drawn one by one") {
  const RandomStream stream(3, 1, "pairs");
  for (std::uint64_t pair = 0; pair < 100; ++pair) {
    const std::array<double, 2> uniforms = stream.uniforms(7, pair);
    const std::array<double, 2> normals = stream.normals(7, pair);
    for (std::uint64_t i = 0; i < 2; ++i) {
      CHECK(uniforms[i] == stream.uniform(7, 2 * pair + i));
      CHECK(normals[i] == stream.normal(7, 2 * pair + i));
    }
  }
}

TEST_CASE("a draw does not depend on what was drawn before") {
  const RandomStream stream(9, 2, "order");
  std::vector<double> forwards, backwards;
  for (std::uint64_t draw = 0; draw < 100; ++draw) forwards.push_back(stream.normal(5, draw));
  const RandomStream again(9, 2, "order");
  for (std::uint64_t draw = 100; draw-- > 0;) {
    again.uniform(4, draw);
    again.poisson(3.0, 5, draw);
    backwards.push_back(again.normal(5, draw));
  }
  std::reverse(backwards.begin(), backwards.end());
  CHECK(forwards == backwards);
}

}  // namespace holdfast
