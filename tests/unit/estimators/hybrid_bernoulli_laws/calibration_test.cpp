// On data drawn from its own model a Bayesian filter is calibrated: what it says with probability r
// happens with probability r, and its errors are as large as its covariances. A filter of a wrong
// model is not.

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "common/random_stream.h"
#include "tests/support/catch.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/filter_route.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/law_cases.h"
#include "tests/unit/estimators/hybrid_bernoulli_laws/law_simulation.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

constexpr int kNumSteps = 20, kMostPackets = 3;
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

// What must be zero on average.
struct Calibration {
  RunMean attack;        // attacked - r
  RunMean attack_slope;  // the same, weighted by r: sure and unsure steps alike
  RunMean error;         // NEES / n - 1 of the state, whether attacked or not
  RunMean rank;          // u - 1/2, u: probability of x_1 being below the true one
  RunMean spread;        // (u - 1/2)^2 - 1/12
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

double probability_below(const GaussianMixture& mixture, double x) {
  double sum = 0.0;
  for (int j = 0; j < mixture.size(); ++j) {
    const double z = (x - mixture.mean(j)[0]) / std::sqrt(mixture.covariance(j)(0, 0));
    sum += mixture.weight(j) * 0.5 * std::erfc(-z / std::sqrt(2.0));
  }
  return sum;
}

void reduce_little(HybridBernoulliOptions& options) {
  options.prune_below = 1e-5;
  options.merge_below = 1e-2;
  options.components_max = 30;
}

struct Setting {
  LawCase law;
  std::uint32_t num_runs = 200;
  CorrectionLaw correction = kInjection;
};

Calibration calibrate(const Setting& setting, const LawCase& belief) {
  Calibration result;
  const auto set_up = [&](HybridBernoulliOptions& options) {
    options.correction = setting.correction == kInjection
                             ? HybridBernoulliOptions::Correction::kInjection
                             : HybridBernoulliOptions::Correction::kSubstitution;
    reduce_little(options);
  };
  for (std::uint32_t run = 0; run < setting.num_runs; ++run) {
    const LawRun data = simulate(setting.law, run, kNumSteps, setting.correction, kMostPackets);
    FilterRoute filter(belief, set_up);
    double attack = 0.0, slope = 0.0, error = 0.0, rank = 0.0, spread = 0.0, packet = 0.0;
    for (std::size_t k = 0; k < data.steps.size(); ++k) {
      const LawPosterior posterior = filter.step(data.steps[k]);
      const LawTruth& now = data.truth[k];
      const double miss = (now.is_attacked ? 1.0 : 0.0) - posterior.r;
      attack += miss;
      slope += miss * posterior.r;
      error += squared_error(posterior, now.x) - 1.0;
      const double u = (1.0 - posterior.r) * probability_below(filter.filter().p0(), now.x[0]) +
                       posterior.r * probability_below(filter.filter().p1(), now.x[0]) - 0.5;
      rank += u;
      spread += u * u - 1.0 / 12.0;
      for (std::size_t p = 0; p < now.authentic.size(); ++p) {
        packet += (now.authentic[p] ? 1.0 : 0.0) - posterior.packet_probability[p];
      }
    }
    result.attack.add(attack);
    result.attack_slope.add(slope);
    result.error.add(error);
    result.rank.add(rank);
    result.spread.add(spread);
    result.packet.add(packet);
  }
  return result;
}

// Three rows of y and fakes that lie about give themselves away: errors are nearly Gaussian, and
// the mean of their squares is a fair statistic.
LawCase clear_case(bool is_direct) {
  LawCase law = random_case(6, 2, 1, 3, is_direct, kInjection, {});
  law.model.R *= 0.3;
  law.attacks[0].terms[0].covariance *= 3.0;
  law.box_low.setConstant(-50.0);
  law.box_high.setConstant(50.0);
  return law;
}

// Fakes are often believed. Authentic values leave the box at times, fakes never do: kZero.
LawCase confusing_case(bool is_direct) {
  LawCase law = random_case(6, 2, 1, 2, is_direct, kInjection, {});
  law.model.R *= 0.1;
  law.attacks[0].terms[0].covariance *= 5.0;
  law.box_low.setConstant(-15.0);
  law.box_high.setConstant(15.0);
  law.outside = OutsideLaw::kZero;
  return law;
}

}  // namespace

TEST_CASE("calibration on data from the model itself") {
  const bool is_direct = GENERATE(true, false);
  const auto correction = GENERATE(kInjection, kSubstitution);
  const Setting clear{clear_case(is_direct), 200, correction};
  const Calibration own = calibrate(clear, clear.law);
  CHECK(std::abs(own.attack.score()) < kBound);
  CHECK(std::abs(own.attack_slope.score()) < kBound);
  CHECK(std::abs(own.error.score()) < kBound);
  CHECK(std::abs(own.rank.score()) < kBound);
  CHECK(std::abs(own.spread.score()) < kBound);
}

TEST_CASE("calibration where fakes are often believed") {
  const bool is_direct = GENERATE(true, false);
  const auto correction = GENERATE(kInjection, kSubstitution);
  const Setting confusing{confusing_case(is_direct), 100, correction};
  const Calibration own = calibrate(confusing, confusing.law);
  CHECK(std::abs(own.attack.score()) < kBound);
  CHECK(std::abs(own.attack_slope.score()) < kBound);
  CHECK(std::abs(own.rank.score()) < kBound);
  CHECK(std::abs(own.spread.score()) < kBound);
  CHECK(std::abs(own.packet.score()) < kBound);
}

TEST_CASE("a filter of a wrong model is not calibrated") {
  const Setting clear{clear_case(true)}, confusing{confusing_case(true), 50};
  LawCase wrong = clear.law;
  wrong.pb *= 3.0;
  CHECK(std::abs(calibrate(clear, wrong).attack.score()) > kBound);
  wrong = clear.law;
  wrong.model.Q *= 0.25;
  const Calibration sure = calibrate(clear, wrong);
  CHECK(std::abs(sure.error.score()) > kBound);
  CHECK(std::abs(sure.spread.score()) > kBound);
  wrong = confusing.law;
  wrong.pd = 0.6;
  CHECK(std::abs(calibrate(confusing, wrong).packet.score()) > kBound);
}

TEST_CASE("an estimated delivery probability is calibrated") {
  LawCase law = clear_case(true);
  LawCase belief = law;
  belief.delivered_count = 4.0;
  belief.lost_count = 2.0;
  RunMean error, slope, prior;
  for (std::uint32_t run = 0; run < 100; ++run) {
    // The fourth smallest of five uniform numbers has that beta density.
    const RandomStream chance(4, run, "test/delivery");
    std::vector<double> draws;
    for (std::uint64_t i = 0; i < 5; ++i) draws.push_back(chance.uniform(0, i));
    std::sort(draws.begin(), draws.end());
    law.pd = draws[3];
    FilterRoute filter(belief, reduce_little);
    for (const LawStep& step : simulate(law, run, kNumSteps, kInjection, kMostPackets).steps) {
      filter.step(step);
    }
    const double miss = law.pd - filter.filter().delivery_probability();
    error.add(miss);
    slope.add(miss * filter.filter().delivery_probability());
    prior.add(std::abs(law.pd - 4.0 / 6.0) - std::abs(miss));
  }
  CHECK(std::abs(error.score()) < kBound);
  CHECK(std::abs(slope.score()) < kBound);
  CHECK(prior.score() > kBound);  // it does learn
}
