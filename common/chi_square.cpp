#include "common/chi_square.h"

#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>

namespace holdfast {

double chi_square_distribution(double x, double degrees_of_freedom) {
  if (std::isinf(x)) return 1.0;
  return boost::math::cdf(boost::math::chi_squared(degrees_of_freedom), x);
}

double chi_square_quantile(double probability, double degrees_of_freedom) {
  return boost::math::quantile(boost::math::chi_squared(degrees_of_freedom), probability);
}

}  // namespace holdfast
