#pragma once

#include "tests/unit/estimators/hybrid_bernoulli_laws/law_case.h"

namespace holdfast::testing {

/// The hybrid Bernoulli posterior after the first steps of a case, without any recursion.
///
/// Every sequence of attacks and every sequence of associations makes all authentic values and the
/// last state jointly Gaussian: one big conditioning each, weighted by its probability. Of the same
/// equations as GridRecursion, but exact for any n, m, l; its cost is exponential in the steps.
/// Precondition: 1 <= num_steps <= law.steps.size().
LawPosterior enumerate_sequences(const LawCase& law, std::size_t num_steps);

}  // namespace holdfast::testing
