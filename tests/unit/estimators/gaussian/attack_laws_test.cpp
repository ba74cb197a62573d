// Laws of the filters that know of attacks on readings, and of the smoothers of all of them.

#include <cmath>
#include <functional>

#include "common/errors.h"
#include "estimators/smoothed_stream.h"
#include "tests/unit/estimators/gaussian/attack_cases.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

using Filters = std::vector<std::pair<std::string, std::unique_ptr<VectorFilter>>>;

double difference_of(const Estimate& a, const Estimate& b) {
  return std::max(difference(a.mean, b.mean), difference(a.covariance, b.covariance));
}

// Every filter that should be a Kalman filter where nobody attacks.
Filters filters_without_attacks(const SystemModel& model, Linearisation linearisation) {
  Filters filters;
  const auto add = [&](const std::string& name, auto options, auto make) {
    options.linearisation = linearisation;
    filters.emplace_back(name, make(options));
  };
  const auto gslr = [&](const GslrOptions& options) {
    return std::make_unique<Gslr>(model, options, kPosition);
  };
  add("exact", gslr_options(no_attacks()), gslr);
  add("paper", gslr_options(no_attacks(), RegressionMoments::kPaper), gslr);
  GslrOptions skips = gslr_options(no_attacks());
  skips.skip_zero = true;
  add("skip zero", skips, gslr);
  add("mixture", mixture_options(no_attacks()), [&](const AttackMixtureOptions& options) {
    return std::make_unique<AttackMixture>(model, options, kPosition);
  });
  AttackMixtureOptions noisy = mixture_options(no_attacks());
  noisy.zero_std = 3.0;
  add("mixture, noisy zeros", noisy, [&](const AttackMixtureOptions& options) {
    return std::make_unique<AttackMixture>(model, options, kPosition);
  });
  return filters;
}

}  // namespace

TEST_CASE("where nobody attacks, every filter and smoother is the Kalman filter and its smoother") {
  for (const bool is_linear : {true, false}) {
    const SystemModel model = is_linear ? aircraft() : radar();
    const auto readings = aircraft_readings(model, 40);
    for (const Linearisation linearisation :
         {Linearisation::kExtended, Linearisation::kUnscented, Linearisation::kCubature}) {
      KalmanFilterOptions options = with_start(KalmanFilterOptions());
      options.linearisation = linearisation;
      KalmanFilter kalman(model, options, kPosition);
      kalman.remember(SmoothingEstimator::kAllSteps);
      Filters filters = filters_without_attacks(model, linearisation);
      for (auto& [name, filter] : filters) filter->remember(SmoothingEstimator::kAllSteps);
      for (int k = 1; k <= 40; ++k) {
        const MeasurementSet set =
            k % 7 == 0 ? empty_set(k)
                       : set_of(k, readings[static_cast<std::size_t>(k - 1)], kPosition);
        const Estimate& wanted = kalman.step(k, set, kNoInput);
        for (auto& [name, filter] : filters) {
          INFO(name << " at step " << k);
          CHECK(difference_of(filter->step(k, set, kNoInput), wanted) < 1e-12);
        }
      }
      const std::vector<Estimate>& wanted = kalman.smooth();
      for (auto& [name, filter] : filters) {
        const std::vector<Estimate>& smoothed = filter->smooth();
        REQUIRE(smoothed.size() == 40);
        for (std::size_t k = 0; k < 40; ++k) {
          INFO(name << " smoothed at step " << k + 1);
          CHECK(difference_of(smoothed[k], wanted[k]) < 1e-10);
        }
      }
    }
  }
}

TEST_CASE("where every reading is forced to zero, filters predict only") {
  AttackAssumptions forced = aircraft_attacks();
  forced.periods.front().attack_probability = 1.0;
  forced.periods.front().dos_probability = 1.0;
  const SystemModel model = aircraft();
  Filters filters;
  filters.emplace_back("exact", std::make_unique<Gslr>(model, gslr_options(forced), kPosition));
  filters.emplace_back(
      "paper",
      std::make_unique<Gslr>(model, gslr_options(forced, RegressionMoments::kPaper), kPosition));
  filters.emplace_back("mixture",
                       std::make_unique<AttackMixture>(model, mixture_options(forced), kPosition));
  KalmanFilter blind(model, with_start(KalmanFilterOptions()), kPosition);
  for (int k = 1; k <= 20; ++k) {
    const MeasurementSet set = set_of(k, Eigen::Vector2d::Zero(), kPosition);
    const Estimate& wanted = blind.step(k, empty_set(k), kNoInput);
    for (auto& [name, filter] : filters) {
      INFO(name);
      const Estimate& estimate = filter->step(k, set, kNoInput);
      CHECK(estimate.outcome == StepOutcome::kOk);
      CHECK(estimate.mean == wanted.mean);
      CHECK(estimate.covariance == wanted.covariance);
    }
  }
}

TEST_CASE("the smoother is the Gaussian conditioned on all readings at once") {
  const SystemModel model = small_model(true);
  const std::vector<bool> attacked(9, false);
  KalmanFilterOptions options;
  options.start = {{1.0, -1.0, 0.5}, {0.7}, {}};
  const Gaussian start = options.start.gaussian(3);
  const Path path(model, start, centred(Eigen::MatrixXd::Identity(2, 2)), attacked, 0);
  for (const Linearisation linearisation :
       {Linearisation::kExtended, Linearisation::kUnscented, Linearisation::kCubature}) {
    for (const SystemModel& variant : {model, as_functions(model)}) {
      options.linearisation = linearisation;
      KalmanFilter filter(variant, options, kTwoSources);
      filter.remember(SmoothingEstimator::kAllSteps);
      Batch batch(model, start, centred(Eigen::MatrixXd::Identity(2, 2)), attacked);
      for (int k = 1; k <= 9; ++k) {
        MeasurementSet set = empty_set(k);
        for (const int source : {1, 0}) {
          if ((k + source) % 3 == 0 || k == 4) continue;
          const std::vector<int>& rows = kTwoSources[static_cast<std::size_t>(source)];
          add_packet(set, source, part_of(path.y[static_cast<std::size_t>(k - 1)], rows));
          batch.observe(k, rows, path.y[static_cast<std::size_t>(k - 1)]);
        }
        filter.step(k, set, kNoInput);
      }
      const std::vector<Estimate>& smoothed = filter.smooth();
      REQUIRE(smoothed.size() == 9);
      for (int k = 1; k <= 9; ++k) {
        const Estimate& estimate = smoothed[static_cast<std::size_t>(k - 1)];
        CHECK(estimate.step == k);
        CHECK(estimate.utime == 1000 * k);
        CHECK(difference(estimate, batch.posterior(k)) < 1e-9);
      }
    }
  }
}

TEST_CASE("one pass of expectation propagation is the collapsing filter with its smoother") {
  const SystemModel model = aircraft();
  auto readings = aircraft_readings(model, 60);
  for (std::size_t k = 3; k < 60; k += 9) readings[k].setZero();
  for (std::size_t k = 5; k < 60; k += 11) readings[k] *= 0.9;
  const AttackMixtureOptions options = mixture_options(aircraft_attacks(), 2);
  AttackMixture two_passes(model, options, kPosition);
  AttackMixture one_pass(model, mixture_options(aircraft_attacks(), 1), kPosition);
  AttackMixture ten_passes(model, mixture_options(aircraft_attacks(), 10), kPosition);
  AttackMixture more_passes(model, mixture_options(aircraft_attacks(), 30), kPosition);
  for (AttackMixture* filter : {&one_pass, &two_passes, &ten_passes, &more_passes}) {
    filter->remember(SmoothingEstimator::kAllSteps);
    for (int k = 1; k <= 60; ++k) {
      filter->step(k, set_of(k, readings[static_cast<std::size_t>(k - 1)], kPosition), kNoInput);
    }
  }
  double second = 0.0, tenth = 0.0;
  for (std::size_t k = 0; k < 60; ++k) {
    second = std::max(second, difference(two_passes.smooth()[k].mean, one_pass.smooth()[k].mean));
    tenth = std::max(tenth, difference(more_passes.smooth()[k].mean, ten_passes.smooth()[k].mean));
  }
  CHECK(second > 1e-6);  // the future changes what a reading means
  CHECK(tenth < 1e-9);   // and the passes settle
}

TEST_CASE("a fixed lag gives each step once, by no more than the readings it may know") {
  const SystemModel model = aircraft();
  const auto readings = aircraft_readings(model, 30);
  for (const std::size_t lag : {1UL, 4UL, 29UL, 40UL, 0UL}) {
    AttackMixture lagged(model, mixture_options(aircraft_attacks(), 1), kPosition);
    SmoothedStream stream(lagged, lag);
    std::vector<Estimate> given;
    const auto take = [&given](const Estimate& estimate) { given.push_back(estimate); };
    for (int k = 1; k <= 30; ++k) {
      lagged.step(k, set_of(k, readings[static_cast<std::size_t>(k - 1)], kPosition), kNoInput);
      stream.on_step(take);
      const std::size_t wanted =
          lag == 0 || static_cast<std::size_t>(k) <= lag ? 0 : static_cast<std::size_t>(k) - lag;
      CHECK(given.size() == wanted);
    }
    stream.finish(take);
    REQUIRE(given.size() == 30);
    for (std::size_t i = 0; i < 30; ++i) {
      CHECK(given[i].step == static_cast<std::int64_t>(i) + 1);
      // The whole run up to where this step's estimate may look.
      const std::size_t last = lag == 0 ? 30 : std::min<std::size_t>(30, i + 1 + lag);
      AttackMixture whole(model, mixture_options(aircraft_attacks(), 1), kPosition);
      whole.remember(SmoothingEstimator::kAllSteps);
      for (std::size_t k = 1; k <= last; ++k) {
        whole.step(static_cast<std::int64_t>(k),
                   set_of(static_cast<std::int64_t>(k), readings[k - 1], kPosition), kNoInput);
      }
      CHECK(difference_of(given[i], whole.smooth()[i]) < 1e-12);
    }
  }
}

TEST_CASE("a forced zero proves itself; noisy ones are weighed") {
  const SystemModel model = aircraft();
  const auto readings = aircraft_readings(model, 10);
  AttackMixture exact(model, mixture_options(aircraft_attacks()), kPosition);
  AttackMixtureOptions noisy_options = mixture_options(aircraft_attacks());
  noisy_options.zero_std = 5.0;
  AttackMixture noisy(model, noisy_options, kPosition);
  for (int k = 1; k <= 9; ++k) {
    const MeasurementSet set = set_of(k, readings[static_cast<std::size_t>(k - 1)], kPosition);
    CHECK(difference_of(exact.step(k, set, kNoInput), noisy.step(k, set, kNoInput)) < 1e-9);
  }
  const auto forced = static_cast<std::size_t>(AttackHypothesis::kForcedToZero);
  const Estimate& proven =
      exact.step(10, set_of(10, Eigen::Vector2d(0.0, -0.0), kPosition), kNoInput);
  CHECK(proven.hypotheses[forced].probability == 1.0);
  CHECK(proven.attack_probability == 1.0);
  const Estimate& likely =
      noisy.step(10, set_of(10, Eigen::Vector2d(1.0, -3.0), kPosition), kNoInput);
  CHECK(likely.hypotheses[forced].probability > 1.0 - 1e-9);
  CHECK(difference(likely.mean, proven.mean) < 1e-6);
  double sum = 0.0;
  for (const HypothesisEstimate& one : likely.hypotheses) sum += one.probability;
  CHECK(sum == Approx(1.0).epsilon(1e-14));
}

TEST_CASE("assumptions change at the steps that say so") {
  const SystemModel model = aircraft();
  const auto readings = aircraft_readings(model, 12);
  AttackAssumptions changing = aircraft_attacks();
  changing.periods.push_back(changing.periods.front());
  changing.periods.back().first_step = 7;
  changing.periods.back().attack_probability = 0.0;
  Gslr changed(model, gslr_options(changing), kPosition);
  Gslr before(model, gslr_options(aircraft_attacks()), kPosition);
  for (int k = 1; k <= 12; ++k) {
    const MeasurementSet set = set_of(k, readings[static_cast<std::size_t>(k - 1)], kPosition);
    const double apart =
        difference_of(changed.step(k, set, kNoInput), before.step(k, set, kNoInput));
    CHECK((apart == 0.0) == (k < 7));
  }
}

TEST_CASE("gslr and attack_mixture: what does not fit is refused, options are read") {
  const SystemModel model = aircraft();
  const auto read = [&](auto options, const std::string& text) {
    ConfigurationDocument document = ConfigurationDocument::from_text(text, "test.yaml");
    ConfigurationMap map = document.root();
    options.read(map, model);
    document.finish();
    return options;
  };
  const auto options = read(
      GslrOptions{},
      "moments: paper\nlinearisation: cubature\nskip_zero: true\nstart: {step: 0, mean: 1}\n"
      "assumes: {attack_probability: 0.5, bias: {probability: 0.25, mean: [1, 2], std: 3}, "
      "scale: {mean: 0.5}, changes: [{first_step: 10, dos_probability: 0.9}, {first_step: 20}]}");
  CHECK(options.moments == RegressionMoments::kPaper);
  CHECK(options.linearisation == Linearisation::kCubature);
  CHECK(options.start_step == 0);
  REQUIRE(options.assumes.periods.size() == 3);
  CHECK(options.assumes.periods[1].first_step == 10);
  CHECK(options.assumes.periods[1].dos_probability == 0.9);
  CHECK(options.assumes.periods[2].dos_probability == 0.9);
  CHECK(options.assumes.periods[2].attack_probability == 0.5);
  CHECK(options.assumes.periods[2].statistics(2).bias_covariance(1, 1) == 9.0);
  const auto refused = [&](auto wrong, const std::string& text) {
    INFO(text);
    CHECK_THROWS_AS(read(wrong, text), ConfigurationError);
  };
  refused(GslrOptions{}, "moments: best");
  refused(GslrOptions{}, "assumes: {attack_probability: 1.5}");
  refused(GslrOptions{}, "assumes: {bias: {mean: [1, 2, 3]}}");
  refused(GslrOptions{}, "assumes: {scale: {std: -1}}");
  refused(GslrOptions{}, "assumes: {changes: [{first_step: 5}, {first_step: 5}]}");
  refused(GslrOptions{}, "zero_std: 1");
  refused(AttackMixtureOptions{}, "zero_std: -1");
  refused(AttackMixtureOptions{}, "smoother_passes: 0");
  GslrOptions wrong = gslr_options(aircraft_attacks());
  wrong.assumes.periods.front().bias.mean = {1.0, 2.0, 3.0};
  CHECK_THROWS_AS(Gslr(model, wrong, kPosition), UsageError);
}
