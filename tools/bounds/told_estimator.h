#pragma once

#include "estimators/attack_statistics.h"

namespace holdfast {

/// What a simulation knows of the step that comes next.
struct ToldTruth {
  bool has_signal_attack = false;
  int mode = 0;                                            // of the plant
  AttackHypothesis frames = AttackHypothesis::kUntouched;  // what rules did to the step's frames
};

/// A bound: an estimator that a simulation tells the truth about attacks before each step.
class ToldEstimator {
 public:
  virtual ~ToldEstimator() = default;
  virtual void tell(const ToldTruth& truth) = 0;
};

}  // namespace holdfast
