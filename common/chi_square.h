#pragma once

namespace holdfast {

/// P(chi-square with that many degrees of freedom <= x).
/// Precondition: degrees_of_freedom > 0, x >= 0; +infinity gives 1.
double chi_square_distribution(double x, double degrees_of_freedom);

/// x with P(chi-square with that many degrees of freedom <= x) = probability.
/// Precondition: degrees_of_freedom > 0, 0 < probability < 1.
double chi_square_quantile(double probability, double degrees_of_freedom);

}  // namespace holdfast
