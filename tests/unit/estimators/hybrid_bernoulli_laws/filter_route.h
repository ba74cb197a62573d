#pragma once

#include <functional>

#include "estimators/hybrid_bernoulli_filter.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/law_case.h"

namespace holdfast::testing {

/// The filter under test, set up for a case and asked for what the other routes say.
///
/// Without reduction unless the change asks for one: exact. The correction is that of the case's
/// steps, kAuto when they differ.
class FilterRoute {
 public:
  using Change = std::function<void(HybridBernoulliOptions&)>;

  explicit FilterRoute(const LawCase& law, const Change& change = {});

  LawPosterior step(const LawStep& step);
  const Estimate& estimate() const { return *estimate_; }
  const HybridBernoulliFilter& filter() const { return filter_; }

 private:
  LawPosterior posterior() const;

  std::size_t num_attacks_;
  HybridBernoulliFilter filter_;
  MeasurementSet set_;
  const Estimate* estimate_ = nullptr;
};

/// The filter without reduction against enumerate_sequences(), the worst step of the case.
double enumeration_disagreement(const LawCase& law);

}  // namespace holdfast::testing
