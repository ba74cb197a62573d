#include "tools/metrics/statistics.h"

#include "tests/unit/tools/metrics/metric_cases.h"

namespace holdfast {
namespace {

using testing::kNan;

// The resample as a list of runs, drawn as RunBootstrap promises.
std::vector<std::size_t> drawn_runs(std::int64_t seed, std::size_t num_runs, std::uint32_t b) {
  const RandomStream draws(static_cast<std::uint64_t>(seed), 0, "campaign/bootstrap");
  std::vector<std::size_t> runs;
  for (std::size_t i = 0; i < num_runs; ++i)
    runs.push_back(static_cast<std::size_t>(draws.uniform(b, i) * static_cast<double>(num_runs)));
  return runs;
}

double population_deviation(const std::vector<double>& values) {
  double sum = 0.0, squares = 0.0;
  for (const double v : values) sum += v;
  const double mean = sum / static_cast<double>(values.size());
  for (const double v : values) squares += (v - mean) * (v - mean);
  return std::sqrt(squares / static_cast<double>(values.size()));
}

}  // namespace

TEST_CASE("a mean's standard error is sd / sqrt(N)") {
  const Statistic mean = mean_of(std::vector<double>{1.0, kNan, 2.0, 6.0});
  CHECK(mean.value == 3.0);
  CHECK(mean.count == 3);
  CHECK(mean.standard_error == Approx(std::sqrt((4.0 + 1.0 + 9.0) / 2.0 / 3.0)).epsilon(1e-15));
  CHECK(std::isnan(mean_of(std::vector<double>{2.0, kNan}).standard_error));
  CHECK(mean_of(std::vector<double>{2.0, kNan}).value == 2.0);
  CHECK(std::isnan(mean_of(std::vector<double>{kNan}).value));
  CHECK(std::isnan(mean_of({}).value));
}

TEST_CASE("the median of an even number is the mean of the middle two") {
  CHECK(median({3.0, 1.0, 2.0}) == 2.0);
  CHECK(median({10.0, 1.0, 3.0, 2.0}) == 2.5);
  CHECK(median({kNan, 7.0}) == 7.0);
  CHECK(std::isnan(median({})));
}

TEST_CASE("a resample's weights are its draws, counted") {
  const RunBootstrap bootstrap(7, 50, 20);
  for (std::uint32_t b = 0; b < 20; ++b) {
    std::vector<int> counts(50, 0);
    for (const std::size_t run : drawn_runs(7, 50, b)) ++counts[run];
    const auto weights = bootstrap.weights(b);
    CHECK(std::equal(weights.begin(), weights.end(), counts.begin(), counts.end()));
  }
}

TEST_CASE("means over a resample leave out what is missing") {
  const RunMatrix matrix = testing::matrix_of(20, 5, [](std::size_t r, std::size_t k) {
    return k == 4 || (r + k) % 3 == 0 ? kNan : testing::normal(r, k, 0);
  });
  const RunBootstrap bootstrap(3, 20, 19);  // more than are summed at once, and a rest
  StepMeans means(matrix);
  CHECK(means.num_runs_with_values() == 20);
  std::uint32_t b = 0;
  means.for_each_resample(bootstrap, [&](std::span<const double> row) {
    REQUIRE(row.size() == 5);
    for (std::size_t k = 0; k < 4; ++k) {
      double sum = 0.0, count = 0.0;
      for (const std::size_t run : drawn_runs(3, 20, b)) {
        if (std::isnan(matrix.run(run)[k])) continue;
        sum += matrix.run(run)[k];
        count += 1.0;
      }
      // Sums of 20 numbers of size 1, taken in another order.
      CHECK(row[k] == Approx(sum / count).margin(1e-14));
    }
    CHECK(std::isnan(row[4]));
    ++b;
  });
  CHECK(b == 19);
}

TEST_CASE("a median's error is that of medians of the drawn values, done by hand") {
  std::vector<RunValue> values;  // run r has r values
  for (std::size_t r = 0; r < 12; ++r) {
    for (std::size_t i = 0; i < r; ++i) values.push_back({r, testing::normal(r, 0, i)});
  }
  const RunBootstrap bootstrap(1, 12, 50);
  const Statistic result = median_of(values, bootstrap);
  std::vector<double> all, resampled;
  for (const RunValue& v : values) all.push_back(v.value);
  CHECK(result.value == median(all));
  CHECK(result.count == 66);
  for (std::uint32_t b = 0; b < 50; ++b) {
    std::vector<double> drawn;
    for (const std::size_t run : drawn_runs(1, 12, b)) {
      for (const RunValue& v : values) {
        if (v.run == run) drawn.push_back(v.value);
      }
    }
    resampled.push_back(median(drawn));
  }
  CHECK(result.standard_error == Approx(population_deviation(resampled)).epsilon(1e-12));
  CHECK(std::isnan(median_of({{3, 1.0}, {3, 2.0}}, bootstrap).standard_error));  // one run only
  CHECK(std::isnan(median_of({}, bootstrap).value));
}

TEST_CASE("a ratio's bootstrap error is the linearised one") {
  const std::size_t num_runs = 400;
  std::vector<double> above(num_runs), below(num_runs);
  for (std::size_t r = 0; r < num_runs; ++r) {
    below[r] = 10.0 + std::floor(20.0 * testing::uniform(r, 0, 0));
    above[r] = std::floor(below[r] * testing::uniform(r, 0, 1));
  }
  const Statistic ratio = ratio_of(above, below, RunBootstrap(1, num_runs, 400));
  double sum_above = 0.0, sum_below = 0.0, squares = 0.0;
  for (std::size_t r = 0; r < num_runs; ++r) {
    sum_above += above[r];
    sum_below += below[r];
  }
  CHECK(ratio.value == sum_above / sum_below);
  CHECK(ratio.count == static_cast<std::int64_t>(sum_below));
  for (std::size_t r = 0; r < num_runs; ++r)
    squares += std::pow(above[r] - ratio.value * below[r], 2);
  // 400 resamples tell a deviation to 1 / sqrt(800) = 3.5 %; four times that, and 1 % for what is
  // not linear.
  CHECK(ratio.standard_error == Approx(std::sqrt(squares) / sum_below).epsilon(0.15));
  CHECK(ratio.standard_error != Approx(1.3 * std::sqrt(squares) / sum_below).epsilon(0.15));
  CHECK(std::isnan(
      ratio_of(std::vector<double>{0.0, 0.0}, std::vector<double>{0.0, 0.0}, RunBootstrap(1, 2, 10))
          .value));
}

}  // namespace holdfast
