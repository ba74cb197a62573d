#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "tools/metrics/bootstrap.h"

namespace holdfast {

inline constexpr double kNoValue = std::numeric_limits<double>::quiet_NaN();

/// A number, its standard error (NaN: none) and how many values went in.
struct Statistic {
  double value = kNoValue, standard_error = kNoValue;
  std::int64_t count = 0;
};

/// Mean of the values that are not NaN; standard error sd / sqrt(N), sd with N - 1.
Statistic mean_of(std::span<const double> values);

/// Median; the mean of the middle two of an even number. NaN are left out; NaN when empty.
double median(std::vector<double> values);

/// A value of the run of that index; a run may have any number of them.
struct RunValue {
  std::size_t run;
  double value;
};

/// Median of all values; standard error by bootstrap over runs.
Statistic median_of(std::vector<RunValue> values, const RunBootstrap& bootstrap);

/// sum numerator / sum denominator over runs; standard error by bootstrap over runs. Count: the sum
/// of the denominators, which are counts. No value when that is 0.
Statistic ratio_of(std::span<const double> numerator, std::span<const double> denominator,
                   const RunBootstrap& bootstrap);

}  // namespace holdfast
