// Whole runs of filters and Rauch-Tung-Striebel smoothers against the vectors of independent code.

#include <functional>

#include "tests/unit/estimators/gaussian/golden_gslr.h"

namespace holdfast {
namespace {

using testing::Kernel;
using testing::matrix_of;
using testing::relative_difference;
using testing::statistics_of;
using testing::update_by;
using testing::vector_of;

constexpr double kRunTolerance = 1e-10;

// One parameter set per step; a file that has one only means it for all.
using ThetaOfStep = std::function<const nlohmann::json&(std::size_t)>;
// A model of each set: linear by its matrices, or a radar's with how it is taken.
using ModelOf = std::function<std::pair<SystemModel, Linearisation>(const nlohmann::json&)>;

template <int N, int L>
std::vector<SmoothingStep<N>> filtered_run(const nlohmann::json& run, const ThetaOfStep& theta_of,
                                           const ModelOf& model_of, Kernel kernel) {
  std::vector<SmoothingStep<N>> steps;
  Belief<N> belief{vector_of(run.at("x0_hat")), matrix_of(run.at("P0"))};
  for (std::size_t k = 0; k < run.at("y").size(); ++k) {
    const nlohmann::json& theta = theta_of(k);
    const auto [system, linearisation] = model_of(theta);
    SizedModel<N, L> model(system, linearisation);
    SmoothingStep<N>& step = steps.emplace_back();
    model.predict(belief, step.cross, step.predicted);
    Observation<N, L> observation;
    model.observe(step.predicted, observation);
    belief = step.predicted;
    const Small<L> y = vector_of(run.at("y").at(k));
    update_by<N, L>(kernel, statistics_of(theta), model.R(), observation, y, belief);
    step.filtered = belief;
  }
  return steps;
}

double largest_difference(const nlohmann::json& wanted, const std::string& key,
                          const std::function<Eigen::MatrixXd(std::size_t)>& value) {
  double scale = 0.0, difference = 0.0;
  for (std::size_t k = 0; k < wanted.at(key).size(); ++k) {
    const nlohmann::json& entry = wanted.at(key).at(k);
    const Eigen::MatrixXd one =
        entry.at(0).is_array() ? matrix_of(entry) : Eigen::MatrixXd(vector_of(entry));
    scale = std::max(scale, one.cwiseAbs().maxCoeff());
    difference = std::max(difference, (one - value(k)).cwiseAbs().maxCoeff());
  }
  return difference / scale;
}

template <int N>
void check_run(const nlohmann::json& wanted, const std::vector<SmoothingStep<N>>& steps) {
  std::vector<Belief<N>> smoothed;
  const auto step_at = [&steps](std::size_t k) -> const SmoothingStep<N>& { return steps[k]; };
  CHECK(smooth_interval(steps.size(), step_at, smoothed) == 0);
  const auto check = [&wanted](const char* key, const auto& value) {
    if (!wanted.contains(key)) return;
    INFO(key);
    CHECK(largest_difference(wanted, key, value) < kRunTolerance);
  };
  check("x_pred", [&](std::size_t k) -> Eigen::MatrixXd { return steps[k].predicted.mean; });
  check("P_pred", [&](std::size_t k) -> Eigen::MatrixXd { return steps[k].predicted.covariance; });
  check("x_filt", [&](std::size_t k) -> Eigen::MatrixXd { return steps[k].filtered.mean; });
  check("P_filt", [&](std::size_t k) -> Eigen::MatrixXd { return steps[k].filtered.covariance; });
  check("x_smooth", [&](std::size_t k) -> Eigen::MatrixXd { return smoothed[k].mean; });
  check("P_smooth", [&](std::size_t k) -> Eigen::MatrixXd { return smoothed[k].covariance; });
  if (wanted.contains("P_filt_last")) {
    CHECK(relative_difference(steps.back().filtered.covariance,
                              matrix_of(wanted.at("P_filt_last"))) < kRunTolerance);
  }
}

const std::vector<std::pair<std::string, Kernel>> kLinear = {{"kf_standard", Kernel::kStandard},
                                                             {"kf_exact", Kernel::kExact},
                                                             {"kf_paper", Kernel::kPaper},
                                                             {"mixture_gpb1", Kernel::kMixture}};

std::pair<SystemModel, Linearisation> linear_model(const nlohmann::json& theta) {
  return {testing::system_of(theta), Linearisation::kExtended};
}

TEST_CASE("linear runs: filters and smoothers, by sizes known and unknown when compiled") {
  const nlohmann::json runs = testing::golden_file("gslr/linear_runs.json").at("runs");
  CHECK(runs.size() == 3);
  int num_checked = 0;
  for (const nlohmann::json& run : runs) {
    INFO(run.at("name").get<std::string>());
    const bool varies = run.contains("theta_per_step");
    const ThetaOfStep theta_of = [&run, varies](std::size_t k) -> const nlohmann::json& {
      return varies ? run.at("theta_per_step").at(k) : run.at("theta");
    };
    for (const auto& [name, kernel] : kLinear) {
      if (!run.contains(name)) continue;
      INFO(name);
      check_run(run.at(name),
                filtered_run<Eigen::Dynamic, Eigen::Dynamic>(run, theta_of, linear_model, kernel));
      if (run.at("x0_hat").size() == 4 && run.at("y").at(0).size() == 2) {
        check_run(run.at(name), filtered_run<4, 2>(run, theta_of, linear_model, kernel));
      }
      ++num_checked;
    }
  }
  CHECK(num_checked == 11);
}

TEST_CASE("a radar's run: extended, cubature and unscented filters and smoothers") {
  const nlohmann::json file = testing::golden_file("gslr/nonlinear.json");
  const nlohmann::json& run = file.at("run");
  TurningTargetOptions options;
  options.sensor = TurningTargetOptions::Sensor::kRadar;
  options.radar_position_m = run.at("radar").get<std::vector<double>>();
  const ThetaOfStep theta_of = [&run](std::size_t) -> const nlohmann::json& {
    return run.at("theta");
  };
  const std::vector<std::pair<std::string, Kernel>> kernels = {{"standard", Kernel::kStandard},
                                                               {"gslr_exact", Kernel::kExact},
                                                               {"gslr_paper", Kernel::kPaper},
                                                               {"mixture_gpb1", Kernel::kMixture}};
  for (const auto& [prefix, linearisation] : {std::pair{"ekf_", Linearisation::kExtended},
                                              std::pair{"cubature_", Linearisation::kCubature},
                                              std::pair{"ut_", Linearisation::kUnscented}}) {
    const ModelOf model_of = [&options, way = linearisation](const nlohmann::json& theta) {
      SystemModel model = make_turning_target_model(options);
      model.A = matrix_of(theta.at("A"));
      model.Q = matrix_of(theta.at("Q"));
      model.R = matrix_of(theta.at("R"));
      return std::pair{model, way};
    };
    for (const auto& [name, kernel] : kernels) {
      INFO(prefix + name);
      check_run(run.at(prefix + name), filtered_run<4, 2>(run, theta_of, model_of, kernel));
    }
  }
}

}  // namespace
}  // namespace holdfast
