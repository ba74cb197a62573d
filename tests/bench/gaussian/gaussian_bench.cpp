// Whole steps of the filters with one Gaussian: predict, correct by one vector, log-likelihood; and
// of 400 steps with their Rauch-Tung-Striebel smoother; and Kalman filters of many runs in lanes.
// One thread; ns per step, us per run.

#include <benchmark/benchmark.h>

#include <numeric>
#include <vector>

#include "common/models/turning_target/turning_target_model.h"
#include "common/random_stream.h"
#include "estimators/attack_mixture.h"
#include "estimators/gslr.h"
#include "estimators/kalman_filter.h"
#include "estimators/kalman_lanes.h"
#include "tests/support/dense_model.h"

namespace {

using namespace holdfast;

constexpr int kSteps = 400;

struct Readings {
  std::vector<int> rows;
  std::vector<std::vector<double>> values;

  explicit Readings(int l) : rows(static_cast<std::size_t>(l)) {
    const RandomStream stream(1, 0, "bench/readings");
    std::iota(rows.begin(), rows.end(), 0);
    for (std::uint32_t k = 0; k < kSteps; ++k) {
      auto& y = values.emplace_back();
      for (int i = 0; i < l; ++i) {
        y.push_back(20.0 + stream.normal(k, static_cast<std::uint64_t>(i)));
      }
    }
  }
};

double run_once(VectorKernel& kernel, const Readings& readings) {
  double log_likelihood = 0.0;
  for (std::size_t k = 0; k < kSteps; ++k) {
    kernel.begin_step(static_cast<std::int64_t>(k) + 1, true);
    kernel.observe();
    log_likelihood += kernel.correct(readings.rows, readings.values[k]).log_density;
    kernel.end_step();
  }
  return log_likelihood;
}

template <class Options>
void filter_steps(benchmark::State& state, const SystemModel& model, const Options& options) {
  const Readings readings(model.num_measurements());
  const auto kernel = make_kernel(model, options);
  for (auto _ : state) benchmark::DoNotOptimize(run_once(*kernel, readings));
  state.counters["ns_per_step"] =
      benchmark::Counter(1e-9 * kSteps * static_cast<double>(state.iterations()),
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

template <class Options>
void filter_and_smoother(benchmark::State& state, const SystemModel& model,
                         const Options& options) {
  const Readings readings(model.num_measurements());
  const auto kernel = make_kernel(model, options);
  for (auto _ : state) {
    kernel->remember(kSteps);
    benchmark::DoNotOptimize(run_once(*kernel, readings));
    kernel->smooth();
  }
}

// Steps of kLaneRuns filters at once, few enough to keep their means in the first cache.
constexpr std::size_t kLaneRuns = 128;

template <int N, int L>
void lane_steps(benchmark::State& state, const SystemModel& model) {
  const Gaussian start{Eigen::VectorXd::Zero(N), 100.0 * Eigen::MatrixXd::Identity(N, N)};
  const RandomStream stream(1, 0, "bench/lanes");
  std::vector<double> readings(L * kLaneRuns), distances(kLaneRuns), densities(kLaneRuns);
  for (std::size_t i = 0; i < readings.size(); ++i) readings[i] = stream.normal(1, i);
  for (auto _ : state) {
    KalmanLanes<N, L> lanes(model, start, kLaneRuns);
    double log_likelihood = 0.0;
    for (std::size_t k = 0; k < kSteps; ++k) {
      lanes.step(readings, distances, densities);
      log_likelihood += densities[k % kLaneRuns];
    }
    benchmark::DoNotOptimize(log_likelihood);
  }
  state.counters["ns_per_filter_step"] =
      benchmark::Counter(1e-9 * kSteps * kLaneRuns * static_cast<double>(state.iterations()),
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

template <class Options>
Options with_attacks(int l) {
  Options options;
  options.assumes.periods.front().bias.mean.assign(static_cast<std::size_t>(l), 0.8);
  options.assumes.periods.front().scale_mean = 0.95;
  return options;
}

}  // namespace

int main(int argc, char** argv) {
  const SystemModel aircraft = make_turning_target_model(TurningTargetOptions());
  const SystemModel dense = testing::dense_model(12, 12);
  AttackMixtureOptions one_pass = with_attacks<AttackMixtureOptions>(2);
  one_pass.smoother_passes = 1;
  const auto add = [](const char* name, auto function, const SystemModel& model,
                      const auto& options) {
    benchmark::RegisterBenchmark(name, [=](benchmark::State& state) {
      function(state, model, options);
    })->Unit(benchmark::kMicrosecond);
  };
  add("step/kalman/4x2", filter_steps<KalmanFilterOptions>, aircraft, KalmanFilterOptions());
  add("step/gslr/4x2", filter_steps<GslrOptions>, aircraft, with_attacks<GslrOptions>(2));
  add("step/attack_mixture/4x2", filter_steps<AttackMixtureOptions>, aircraft, one_pass);
  add("step/kalman/12x12", filter_steps<KalmanFilterOptions>, dense, KalmanFilterOptions());
  add("run/kalman_rts/4x2", filter_and_smoother<KalmanFilterOptions>, aircraft,
      KalmanFilterOptions());
  add("run/attack_mixture_rts/4x2", filter_and_smoother<AttackMixtureOptions>, aircraft, one_pass);
  add("run/attack_mixture_ep3/4x2", filter_and_smoother<AttackMixtureOptions>, aircraft,
      with_attacks<AttackMixtureOptions>(2));
  benchmark::RegisterBenchmark("lanes/kalman/4x2", [=](benchmark::State& state) {
    lane_steps<4, 2>(state, aircraft);
  })->Unit(benchmark::kMicrosecond);
  benchmark::RegisterBenchmark("lanes/kalman/12x12", [=](benchmark::State& state) {
    lane_steps<12, 12>(state, dense);
  })->Unit(benchmark::kMicrosecond);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
