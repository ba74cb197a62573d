// Whole steps of the hybrid Bernoulli filter: predict, correct by 20 packets, prune, merge,
// estimate; n = 10 states, m = 2 channels, l = 10 rows, one thread.
//
//   step/own/J      J components are corrected, no two with the same covariance
//   step/shared/J   the same, with one covariance in p0 and one in p1
//   step/pruned/J   as own, with far packets: what a step costs when nothing but J parents survive
//
// J counts the components of p0 and p1 together after prediction (half of them in each), which is
// what every packet is compared with. The belief is put back before each step, which copies it.

#include <benchmark/benchmark.h>

#include <cmath>
#include <vector>

#include "common/random_stream.h"
#include "estimators/hybrid_bernoulli_filter.h"

namespace {

using namespace holdfast;

constexpr int kStates = 10, kChannels = 2;
constexpr std::uint32_t kPackets = 20;

Eigen::MatrixXd normal_matrix(const RandomStream& stream, std::uint32_t step, int rows, int columns,
                              double scale) {
  Eigen::MatrixXd matrix(rows, columns);
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      matrix(i, j) = scale * stream.normal(step, static_cast<std::uint32_t>(i * columns + j));
    }
  }
  return matrix;
}

SystemModel dense_model() {
  const RandomStream stream(1, 0, "bench/model");
  const auto identity = Eigen::MatrixXd::Identity(kStates, kStates);
  SystemModel model;
  model.A = 0.9 * identity + normal_matrix(stream, 1, kStates, kStates, 0.02);
  model.C = identity + normal_matrix(stream, 2, kStates, kStates, 0.1);
  model.G = normal_matrix(stream, 3, kStates, kChannels, 0.3);
  model.H = normal_matrix(stream, 4, kStates, kChannels, 1.0);
  model.Q = 0.01 * identity;
  model.R = 0.1 * identity;
  return model;
}

HybridBernoulliBelief belief_of(int components, bool is_shared,
                                const HybridBernoulliLayout& layout) {
  const RandomStream stream(1, 0, "bench/belief");
  HybridBernoulliBelief belief;
  belief.set_attack_probability(0.5);
  belief.p0 = GaussianMixture(layout.dimension0());
  belief.p1 = GaussianMixture(layout.dimension1());
  for (GaussianMixture* mixture : {&belief.p0, &belief.p1}) {
    const int d = mixture->dimension();
    int shared = -1;
    for (int j = 0; j < components; ++j) {
      const auto draw = static_cast<std::uint32_t>(2 * j + (mixture == &belief.p0 ? 0 : 1));
      const Eigen::MatrixXd root = normal_matrix(stream, draw, d, d, 0.05);
      const Eigen::MatrixXd P = 0.05 * Eigen::MatrixXd::Identity(d, d) + root * root.transpose();
      const Eigen::VectorXd mean = normal_matrix(stream, 1000 + draw, d, 1, 1.0);
      ComponentTag tag;
      tag.attack_model = mixture == &belief.p0 ? -1 : 0;
      if (is_shared && shared >= 0) {
        mixture->mean(mixture->add(-std::log(components), shared, tag)) = mean;
      } else {
        shared = mixture->covariance_index(mixture->add(-std::log(components), mean, P, tag));
      }
    }
  }
  return belief;
}

MeasurementSet packets_of(std::uint32_t packets, double spread) {
  const RandomStream stream(1, 0, "bench/packets");
  MeasurementSet set;
  set.clear(1, 1);
  for (std::uint32_t p = 0; p < packets; ++p) {
    std::vector<double> y;
    for (std::uint32_t i = 0; i < kStates; ++i) y.push_back(spread * stream.normal(p, i));
    set.add({}, y);
  }
  return set;
}

void run(benchmark::State& state, bool is_shared, double spread, std::uint32_t packets = kPackets,
         double prune_below = 1e-3) {
  const SystemModel model = dense_model();
  HybridBernoulliOptions options;
  options.components_max = 100;
  options.prune_below = prune_below;
  HybridBernoulliFilter filter(model, options, {{0, 1, 2, 3, 4, 5, 6, 7, 8, 9}});
  // Prediction joins p0 and p1 into both, so a quarter of the components in each parent.
  const auto belief =
      belief_of(std::max(1, static_cast<int>(state.range(0)) / 4), is_shared, filter.layout());
  const MeasurementSet set = packets_of(packets, spread);
  std::int64_t step = 0;
  for (auto _ : state) {
    filter.set_belief(belief, false);
    benchmark::DoNotOptimize(filter.step(++step, set, {}).mean.data());
  }
  state.counters["candidates"] = static_cast<double>(filter.num_candidates());
  state.counters["components_left"] = filter.num_components();
}

void own(benchmark::State& state) {
  run(state, false, 1.0);
}
void shared(benchmark::State& state) {
  run(state, true, 1.0);
}
void pruned(benchmark::State& state) {
  run(state, false, 8.0);
}

// The worst that an attacker can ask for: nothing is pruned, and little merges.
void flood(benchmark::State& state) {
  run(state, false, 1.0, 500, 0.0);
}

BENCHMARK(flood)->Name("step/flood_of_500")->Arg(20)->Arg(100)->Unit(benchmark::kMillisecond);
BENCHMARK(own)->Name("step/own")->Arg(20)->Arg(50)->Arg(100)->Unit(benchmark::kMicrosecond);
BENCHMARK(shared)->Name("step/shared")->Arg(20)->Arg(50)->Arg(100)->Unit(benchmark::kMicrosecond);
BENCHMARK(pruned)->Name("step/pruned")->Arg(20)->Arg(50)->Arg(100)->Unit(benchmark::kMicrosecond);

}  // namespace

BENCHMARK_MAIN();
