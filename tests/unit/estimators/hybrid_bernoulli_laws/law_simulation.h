#pragma once

#include <cstdint>
#include <vector>

#include "tests/unit/estimators/hybrid_bernoulli_laws/law_case.h"

namespace holdfast::testing {

/// What was the case at one step of a simulated run.
struct LawTruth {
  bool is_attacked = false;  // of the attack that the step's r is about
  int attack = -1;
  Eigen::VectorXd x, a;         // a over all channels, 0 without attack
  std::vector<bool> authentic;  // of each packet
};

struct LawRun {
  std::vector<LawStep> steps;
  std::vector<LawTruth> truth;
};

/// A run drawn from the model that the case states, so that a filter of that case is calibrated.
///
/// Each source sends an authentic packet with probability pd (injection) or always, replaced with
/// probability pf (substitution). The number of packets of a source is uniform on 1 .. most and
/// says nothing of the delivery (the improper "any number of fakes" of eq. (13), paper 003).
LawRun simulate(const LawCase& law, std::uint32_t run, int num_steps, CorrectionLaw correction,
                int most_packets);

}  // namespace holdfast::testing
