// On data drawn from its own model a Bayesian filter is calibrated: what it says with probability r
// happens with probability r, and its errors are as large as its covariances. A filter of a wrong
// model is not.

#include <Eigen/Cholesky>
#include <cmath>
#include <functional>

#include "tests/support/catch.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/filter_route.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/law_cases.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/law_simulation.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

constexpr auto kInjection = CorrectionLaw::kInjection, kSubstitution = CorrectionLaw::kSubstitution;
constexpr int kNumRuns = 300, kNumSteps = 20;
// Two-sided 1e-4 of a normal distribution; of a mean over runs, which are independent.
constexpr double kBound = 3.9;

// A mean over runs that ought to be zero, in standard errors.
class RunMean {
 public:
  void add(double value) {
    sum_ += value;
    squares_ += value * value;
    ++size_;
  }
  double score() const {
    const double mean = sum_ / size_, variance = squares_ / size_ - mean * mean;
    return mean / std::sqrt(variance / size_);
  }

 private:
  double sum_ = 0.0, squares_ = 0.0;
  int size_ = 0;
};

struct Calibration {
  RunMean attack;        // attacked - r
  RunMean attack_slope;  // the same, weighted by r: sure and unsure steps alike
  RunMean error;         // NEES / n - 1 of the state, whether attacked or not
  RunMean packet;        // authentic - its probability
};

double squared_error(const LawPosterior& posterior, const Eigen::VectorXd& x) {
  const Eigen::Index n = x.size();
  const double r = posterior.r;
  const Eigen::VectorXd mean = (1.0 - r) * posterior.mean0 + r * posterior.mean1.head(n);
  const Eigen::MatrixXd square =
      (1.0 - r) * posterior.square0 + r * posterior.square1.topLeftCorner(n, n);
  const Eigen::MatrixXd covariance = square - mean * mean.transpose();
  return (x - mean).dot(covariance.llt().solve(x - mean)) / static_cast<double>(n);
}

Calibration calibrate(const LawCase& truth, const LawCase& belief, CorrectionLaw correction) {
  Calibration result;
  const auto reduce = [correction](HybridBernoulliOptions& options) {
    options.correction = correction == kInjection
                             ? HybridBernoulliOptions::Correction::kInjection
                             : HybridBernoulliOptions::Correction::kSubstitution;
    options.prune_below = 1e-5;
    options.merge_below = 1e-2;
    options.components_max = 40;
  };
  for (std::uint32_t run = 0; run < kNumRuns; ++run) {
    const LawRun data = simulate(truth, run, kNumSteps, correction, 3);
    FilterRoute filter(belief, reduce);
    double attack = 0.0, slope = 0.0, error = 0.0, packet = 0.0;
    for (std::size_t k = 0; k < data.steps.size(); ++k) {
      const LawPosterior posterior = filter.step(data.steps[k]);
      const LawTruth& now = data.truth[k];
      const double miss = (now.is_attacked ? 1.0 : 0.0) - posterior.r;
      attack += miss;
      slope += miss * posterior.r;
      error += squared_error(posterior, now.x) - 1.0;
      for (std::size_t p = 0; p < now.authentic.size(); ++p) {
        packet += (now.authentic[p] ? 1.0 : 0.0) - posterior.packet_probability[p];
      }
    }
    result.attack.add(attack);
    result.attack_slope.add(slope);
    result.error.add(error);
    result.packet.add(packet);
  }
  return result;
}

LawCase calibration_case(bool is_direct) {
  LawCase law = random_case(6, 2, 1, 2, is_direct, kInjection, {});
  // Such that an attack can be seen and a fake can be believed, both often but not always; and
  // that authentic values hardly ever leave the box.
  law.model.R *= 0.1;
  law.model.Q *= 0.5;
  law.attacks[0].terms[0].covariance *= 5.0;
  law.box_low.setConstant(-15.0);
  law.box_high.setConstant(15.0);
  return law;
}

}  // namespace

TEST_CASE("calibration on data from the model itself") {
  const bool is_direct = GENERATE(true, false);
  const auto correction = GENERATE(kInjection, kSubstitution);
  const LawCase law = calibration_case(is_direct);
  const Calibration own = calibrate(law, law, correction);
  CHECK(std::abs(own.attack.score()) < kBound);
  CHECK(std::abs(own.attack_slope.score()) < kBound);
  CHECK(std::abs(own.error.score()) < kBound);
  CHECK(std::abs(own.packet.score()) < kBound);
}

TEST_CASE("calibration fails with a wrong birth probability, a wrong Q, a wrong pd") {
  const LawCase law = calibration_case(true);
  LawCase wrong = law;
  wrong.pb = 3.0 * law.pb;
  CHECK(std::abs(calibrate(law, wrong, kInjection).attack.score()) > kBound);
  wrong = law;
  wrong.model.Q *= 4.0;
  CHECK(std::abs(calibrate(law, wrong, kInjection).error.score()) > kBound);
  wrong = law;
  wrong.pd = 0.7;
  CHECK(std::abs(calibrate(law, wrong, kInjection).packet.score()) > kBound);
}
