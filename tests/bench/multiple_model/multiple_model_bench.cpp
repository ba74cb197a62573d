// Steps of the filter of state and unknown inputs with its likelihood, and of banks of five modes:
// with converged gains, and with gains computed anew in each step, as banks of changing modes do.

#include <benchmark/benchmark.h>

#include <numeric>
#include <string>
#include <thread>
#include <vector>

#include "common/models/three_area/three_area_model.h"
#include "estimators/mode_bank.h"

namespace {

using namespace holdfast;

std::vector<SystemModel> three_areas() {
  const ThreeAreaOptions options;
  std::vector<SystemModel> modes;
  for (const std::string& ties : options.ties)
    modes.push_back(make_three_area_model(options, ties));
  return modes;
}

// The fifth-order benchmark; a mode for each channel that is left out.
std::vector<SystemModel> attack_locations() {
  SystemModel model;
  model.A = (Eigen::MatrixXd(5, 5) << 0.5, 2, 0, 0, 0, 0, 0.2, 1, 0, 1, 0, 0, 0.3, 0, 1, 0, 0, 0,
             0.7, 1, 0, 0, 0, 0, 0.1)
                .finished();
  model.C = (Eigen::MatrixXd(5, 5) << 1, 0, 0, 0, 0, 0, 1, -0.1, 0, 0, 0, 0, 1, -0.5, 0.2, 0, 0, 0,
             1, 0, 0, 0.25, 0, 0, 1)
                .finished();
  model.G = Eigen::MatrixXd::Zero(5, 5);
  model.G.col(0) << 1, 0.1, 0.1, 1, 0;
  model.H = Eigen::MatrixXd::Zero(5, 5);
  model.H.topRightCorner(4, 4).setIdentity();
  model.B = model.G.col(0);
  model.D = Eigen::MatrixXd::Zero(5, 1);
  model.Q = model.R = 1e-4 * Eigen::MatrixXd::Identity(5, 5);
  std::vector<SystemModel> modes;
  for (int left_out = 4; left_out >= 0; --left_out) {
    std::vector<int> channels;
    for (int i = 0; i < 5; ++i) {
      if (i != left_out) channels.push_back(i);
    }
    modes.push_back(model.with_attack_channels(channels));
  }
  return modes;
}

std::vector<int> all_rows(const SystemModel& model) {
  std::vector<int> rows(static_cast<std::size_t>(model.num_measurements()));
  std::iota(rows.begin(), rows.end(), 0);
  return rows;
}

Eigen::VectorXd reading(const SystemModel& model) {
  return Eigen::VectorXd::LinSpaced(model.num_measurements(), -1.0, 1.0);
}

void filter_step(benchmark::State& state, const SystemModel& model, bool converges) {
  InputStateFilter filter({model}, {});
  if (!converges) filter.never_converge();
  const std::vector<int> rows = all_rows(model);
  const Eigen::VectorXd y = reading(model), u = Eigen::VectorXd::Ones(model.num_inputs());
  for (int k = 0; k < 2000; ++k) filter.step(0, rows, y, u);
  double sum = 0.0;
  for (auto _ : state) sum += filter.step(0, rows, y, u).log_likelihood;
  benchmark::DoNotOptimize(sum);
}

void bank_step(benchmark::State& state, const std::vector<SystemModel>& modes, bool is_dynamic) {
  ModeBankOptions options;
  if (is_dynamic) {
    options.transition = Eigen::MatrixXd::Constant(5, 5, 0.0025);
    options.transition.diagonal().setConstant(0.99);
  }
  ModeBank bank(modes, options);
  const std::vector<int> rows = all_rows(modes[0]);
  const Eigen::VectorXd y = reading(modes[0]), u = Eigen::VectorXd::Ones(modes[0].num_inputs());
  for (int k = 0; k < 2000; ++k) bank.step(rows, y, u);
  for (auto _ : state) bank.step(rows, y, u);
  benchmark::DoNotOptimize(bank.probability().data());
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<SystemModel> areas = three_areas(), locations = attack_locations();
  const auto add = [](const std::string& name, const auto& run) {
    return benchmark::RegisterBenchmark(name.c_str(), run);
  };
  for (const bool converges : {true, false}) {
    const std::string how = converges ? "/converged" : "/anew";
    add("filter/n12_l12_p3" + how,
        [&, converges](benchmark::State& state) { filter_step(state, areas[1], converges); });
    add("filter/n5_l5_p4" + how,
        [&, converges](benchmark::State& state) { filter_step(state, locations[2], converges); });
  }
  for (const bool is_dynamic : {false, true}) {
    const std::string how = is_dynamic ? "/dynamic" : "/static";
    for (const int threads : {1, 2}) {
      add("bank_of_5/n12_l12_p3" + how, [&, is_dynamic](benchmark::State& state) {
        bank_step(state, areas, is_dynamic);
      })->Threads(threads);
      add("bank_of_5/n5_l5_p4" + how, [&, is_dynamic](benchmark::State& state) {
        bank_step(state, locations, is_dynamic);
      })->Threads(threads);
    }
  }
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
