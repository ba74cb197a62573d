#include "common/chi_square.h"

#include <cmath>
#include <limits>

#include "tests/support/catch.h"

using namespace holdfast;

TEST_CASE("chi-square quantiles are those of the tables") {
  const auto allowed = [](double value) { return Approx(value).epsilon(1e-8); };  // table's digits
  CHECK(chi_square_quantile(0.95, 1) == allowed(3.841458821));
  CHECK(chi_square_quantile(0.025, 4) == allowed(0.4844185571));
  CHECK(chi_square_quantile(0.975, 4) == allowed(11.14328678));
  CHECK(chi_square_quantile(0.025, 10) == allowed(3.246972780));
  CHECK(chi_square_quantile(0.975, 10) == allowed(20.48317735));
  CHECK(chi_square_quantile(0.99, 30) == allowed(50.89218131));
  CHECK(chi_square_quantile(0.975, 4000) == allowed(4177.191056));  // a campaign's
  // Two degrees of freedom: exponential.
  for (const double p : {1e-4, 0.025, 0.5, 0.975, 0.9999})
    CHECK(chi_square_quantile(p, 2) == Approx(-2.0 * std::log1p(-p)).epsilon(1e-12));
}

TEST_CASE("the chi-square distribution is the quantile's inverse and, for even degrees, a sum") {
  for (const double degrees : {1.0, 2.0, 7.0, 10.0, 300.0}) {
    for (const double p : {1e-4, 0.025, 0.5, 0.975, 0.9999}) {
      CHECK(chi_square_distribution(chi_square_quantile(p, degrees), degrees) ==
            Approx(p).epsilon(1e-9));
    }
  }
  // P(chi-square with 2 n <= x) = 1 - exp(-x/2) sum_{i < n} (x/2)^i / i!
  for (const double x : {0.1, 3.0, 12.0, 40.0}) {
    double term = 1.0, sum = 0.0;
    for (int i = 0; i < 5; ++i) {
      sum += term;
      term *= 0.5 * x / (i + 1);
    }
    CHECK(chi_square_distribution(x, 10.0) == Approx(1.0 - std::exp(-0.5 * x) * sum).margin(1e-13));
  }
  CHECK(chi_square_distribution(0.0, 3.0) == 0.0);
  CHECK(chi_square_distribution(1e204, 3.0) == 1.0);
  CHECK(chi_square_distribution(std::numeric_limits<double>::infinity(), 3.0) == 1.0);
}
