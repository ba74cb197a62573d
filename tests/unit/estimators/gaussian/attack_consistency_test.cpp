// Whether filters of attacked readings know how wrong they are: e' P^-1 e over runs from a random
// start, in steps far enough from it.

#include <Eigen/Cholesky>
#include <cmath>
#include <memory>
#include <vector>

#include "tests/unit/estimators/gaussian/attack_cases.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

constexpr int kFlightRuns = 8000, kFlightSteps = 40, kFlightStates = 4;

// The aircraft from N(m0, P0) of the filters' own start, attacked as the paper's Table I says.
class AttackedFlight {
 public:
  AttackedFlight(const SystemModel& model, const Gaussian& start, std::uint32_t run)
      : model_(model), stream_(17, run, "test/attacked_flight"), x_(sample(start, stream_, 0, 0)) {}

  const Eigen::VectorXd& state() const { return x_; }

  /// Moves, and reads y of what the attacks leave of it.
  void advance(std::uint32_t step, const AttackStatistics& attacks, std::vector<double>& y) {
    x_ = model_.A * x_ + sample(centred(model_.Q), stream_, step, 100);
    Eigen::VectorXd reading = model_.C * x_ + sample(centred(model_.R), stream_, step, 200);
    if (stream_.uniform(step, 300) < attacks.attack_probability) {
      if (stream_.uniform(step, 302) < attacks.dos_probability) {
        reading.setZero();
      } else {
        if (stream_.uniform(step, 304) < attacks.bias_probability)
          reading += sample({attacks.bias_mean, attacks.bias_covariance}, stream_, step, 400);
        if (stream_.uniform(step, 306) < attacks.scale_probability)
          reading *= attacks.scale_mean + attacks.scale_std * stream_.normal(step, 500);
      }
    }
    y.assign(reading.begin(), reading.end());
  }

 private:
  const SystemModel& model_;
  RandomStream stream_;
  Eigen::VectorXd x_;
};

struct MeanNees {
  double mean, error;
};

// Of the last step of each run, so that what is averaged is independent.
template <class Options>
MeanNees mean_nees(const Options& options, const AttackAssumptions& truth) {
  const SystemModel model = aircraft();
  const AttackStatistics attacks = truth.periods.front().statistics(2);
  const Gaussian start = options.start.gaussian(kFlightStates);
  const std::vector<int> rows = {0, 1};
  std::vector<double> y;
  double sum = 0.0, squares = 0.0;
  for (std::uint32_t run = 0; run < kFlightRuns; ++run) {
    AttackedFlight flight(model, start, run);
    const std::unique_ptr<VectorKernel> kernel = make_kernel(model, options);
    for (std::uint32_t step = 1; step <= kFlightSteps; ++step) {
      flight.advance(step, attacks, y);
      kernel->begin_step(step, true);
      kernel->observe();
      kernel->correct(rows, y);
      kernel->end_step();
    }
    Estimate estimate;
    kernel->publish(estimate);
    const double one = nees(flight.state(), estimate.mean, estimate.covariance);
    sum += one;
    squares += one * one;
  }
  const double mean = sum / kFlightRuns;
  return {mean, std::sqrt((squares / kFlightRuns - mean * mean) / kFlightRuns)};
}

}  // namespace

TEST_CASE("filters that know of the attacks know how wrong they are, others do not") {
  const AttackAssumptions truth = aircraft_attacks();

  // e' P^-1 e of a Gaussian error is chi-square with kFlightStates degrees of freedom.
  const double error = std::sqrt(2.0 * kFlightStates / kFlightRuns);
  // A few runs that diverge would widen a mean's own error as fast as they move the mean.
  const auto is_honest = [error](const MeanNees& nees) {
    return std::abs(nees.mean - kFlightStates) < 4.0 * error && nees.error < 1.3 * error;
  };

  const MeanNees untouched = mean_nees(with_start(KalmanFilterOptions()), no_attacks());
  const MeanNees mixture = mean_nees(mixture_options(truth, 1), truth);
  const MeanNees exact = mean_nees(gslr_options(truth), truth);
  CAPTURE(untouched.mean, mixture.mean, exact.mean);
  CAPTURE(error, untouched.error, mixture.error, exact.error);
  CHECK(is_honest(untouched));
  CHECK(is_honest(mixture));
  CHECK(is_honest(exact));

  // The printed variance is too large, so that filter takes itself for worse than it is.
  const MeanNees printed = mean_nees(gslr_options(truth, RegressionMoments::kPaper), truth);
  const MeanNees unaware = mean_nees(with_start(KalmanFilterOptions()), truth);
  CAPTURE(printed.mean, printed.error, unaware.mean, unaware.error);
  CHECK(printed.mean < kFlightStates - 4.0 * printed.error);
  CHECK(unaware.mean > kFlightStates + 4.0 * unaware.error);
}
