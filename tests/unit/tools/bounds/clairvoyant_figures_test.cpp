// The "clair" columns of the method page of the hybrid Bernoulli filter, section 6: means over runs
// of per-run RMSE with their standard errors, by an independent implementation.
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "common/models/ieee14/ieee14_model.h"
#include "tests/unit/estimators/baselines/baseline_cases.h"
#include "tools/bounds/clairvoyant_filter.h"

using namespace holdfast;
using namespace holdfast::testing;

namespace {

struct Case {
  SystemModel model;
  ClairvoyantFilterOptions options;
  Eigen::VectorXd attack;
  int steps = 0, first_attacked = 0, last_attacked = 0;
  double delivery_probability = 1.0;
};

/// What is scored at a step: its name, and the squared errors of a block.
struct Block {
  std::string name;
  int first = 0, size = 0;  // of [x; a]
};

enum class When { kBefore, kAttackedAndFresh, kAttacked };

// Mean over runs, and its standard error, of the root of the mean square over steps and block.
struct Figure {
  double mean = 0.0, standard_error = 0.0;
};

class Score {
 public:
  void add(double squared_error) {
    sum_ += squared_error;
    count_ += 1.0;
  }
  double rmse() const { return std::sqrt(sum_ / count_); }

 private:
  double sum_ = 0.0, count_ = 0.0;
};

Figure figure_of(const std::vector<double>& values) {
  Figure figure;
  const auto count = static_cast<double>(values.size());
  for (const double value : values) figure.mean += value / count;
  for (const double value : values) {
    figure.standard_error += (value - figure.mean) * (value - figure.mean);
  }
  figure.standard_error = std::sqrt(figure.standard_error / (count - 1.0) / count);
  return figure;
}

bool counts(const Case& scene, When when, int k, const std::vector<bool>& delivered) {
  const bool is_attacked = k >= scene.first_attacked && k <= scene.last_attacked;
  if (when == When::kBefore) return k >= 10 && k < scene.first_attacked;
  if (when == When::kAttacked) return is_attacked;
  const auto at = static_cast<std::size_t>(k);
  return is_attacked && delivered[at] && delivered[at - 1] && delivered[at - 2];
}

std::map<std::string, Figure> figures(const Case& scene, const std::vector<Block>& blocks,
                                      const std::vector<When>& when, std::uint32_t runs) {
  const int n = scene.model.num_states();
  Rows rows(1);
  for (int i = 0; i < scene.model.num_measurements(); ++i) rows[0].push_back(i);
  std::map<std::string, std::vector<double>> values;
  for (std::uint32_t run = 0; run < runs; ++run) {
    const RandomStream stream(1, run, "test/clairvoyant");
    ClairvoyantFilter filter(scene.model, scene.options, rows);
    std::vector<bool> delivered(static_cast<std::size_t>(scene.steps) + 1);
    std::vector<Score> scores(blocks.size());
    Eigen::VectorXd x = Eigen::VectorXd::Zero(n), truth(n + scene.attack.size());
    for (int k = 1; k <= scene.steps; ++k) {
      const auto draw = static_cast<std::uint32_t>(k);
      const bool is_attacked = k >= scene.first_attacked && k <= scene.last_attacked;
      const Eigen::VectorXd a = (is_attacked ? 1.0 : 0.0) * scene.attack;
      const Eigen::VectorXd y =
          scene.model.C * x + scene.model.H * a + sample(centred(scene.model.R), stream, draw, 0);
      const bool arrives = stream.uniform(draw, 1000) < scene.delivery_probability;
      delivered[static_cast<std::size_t>(k)] = arrives;
      filter.tell({is_attacked, {}});
      const Estimate& estimate =
          filter.step(k, arrives ? set_of(k, y, rows) : empty_set(k), kNoInput);
      truth << x, a;
      for (std::size_t b = 0; b < blocks.size(); ++b) {
        if (!counts(scene, when[b], k, delivered)) continue;
        for (int i = blocks[b].first; i < blocks[b].first + blocks[b].size; ++i) {
          const double error = truth[i] - (i < n ? estimate.mean[i] : estimate.input_mean[i - n]);
          scores[b].add(error * error);
        }
      }
      x = (scene.model.A * x + scene.model.G * a +
           sample(centred(scene.model.Q), stream, draw, 100))
              .eval();
    }
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      values[blocks[b].name].push_back(scores[b].rmse());
    }
  }
  std::map<std::string, Figure> result;
  for (const auto& [name, per_run] : values) result[name] = figure_of(per_run);
  return result;
}

// Both means are of runs: their difference within four of its standard errors, and half a unit of
// the page's last digit.
void check(const Figure& ours, double wanted, double standard_error, double digit) {
  const double allowed = 4.0 * std::hypot(standard_error, ours.standard_error) + 0.5 * digit;
  INFO(ours.mean << " +- " << ours.standard_error << " for " << wanted << ", allowed " << allowed);
  CHECK(std::abs(ours.mean - wanted) < allowed);
  CHECK(allowed < 0.1 * wanted);  // the check can fail
}

Case benchmark() {
  Case scene;
  SystemModel& model = scene.model;
  model.A.resize(5, 5);
  model.A << 0.5, 2, 0, 0, 0, 0, 0.2, 1, 0, 1, 0, 0, 0.3, 0, 1, 0, 0, 0, 0.7, 1, 0, 0, 0, 0, 0.1;
  model.C.resize(5, 5);
  model.C << 1, 0, 0, 0, 0, 0, 1, -0.1, 0, 0, 0, 0, 1, -0.5, 0.2, 0, 0, 0, 1, 0, 0, 0.25, 0, 0, 1;
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(5, 5);
  model.Q = model.R = identity;
  model.Q(1, 2) = model.Q(2, 1) = 0.5;
  model.R(0, 3) = model.R(3, 0) = 0.5;
  model.R(1, 4) = model.R(4, 1) = 0.3;
  model.Q *= 1e-4;
  model.R *= 1e-4;
  model.G.resize(5, 2);
  model.G << identity.col(0), identity.col(1);
  model.H.resize(5, 2);
  model.H << identity.col(2), identity.col(0);
  scene.options.start = {{10.0, 10.0, 0.0, 0.0, 0.0}, {100.0}, {}};
  scene.options.attack_prior = {{15.1, 25.53}, {std::sqrt(50.0)}, {}};
  scene.attack = Eigen::Vector2d(10.0, 20.0);
  scene.steps = 500;
  scene.first_attacked = 150;
  scene.last_attacked = 349;
  scene.delivery_probability = 0.98;
  return scene;
}

}  // namespace

TEST_CASE("the clairvoyant filter's errors on the fifth-order benchmark are the method page's") {
  const std::vector<Block> blocks = {
      {"x1 before", 0, 1}, {"x2 before", 1, 1}, {"x3..5 before", 2, 3}, {"x1", 0, 1},
      {"x2", 1, 1},        {"x3..5", 2, 3},     {"a1", 5, 1},           {"a2", 6, 1}};
  std::vector<When> when(3, When::kBefore);
  when.resize(8, When::kAttackedAndFresh);
  auto result = figures(benchmark(), blocks, when, 60);
  check(result["x1 before"], 0.00899, 0.00006, 1e-5);
  check(result["x2 before"], 0.00820, 0.00006, 1e-5);
  check(result["x3..5 before"], 0.00755, 0.00003, 1e-5);
  check(result["x1"], 0.0254, 0.0001, 1e-4);
  check(result["x2"], 0.00973, 0.00005, 1e-5);
  check(result["x3..5"], 0.00914, 0.00003, 1e-5);
  check(result["a1"], 0.01543, 0.00008, 1e-5);
  check(result["a2"], 0.02694, 0.00015, 1e-5);
}

TEST_CASE("the clairvoyant filter's errors on the 14-bus network are the method page's") {
  for (const auto preset : {Ieee14Options::Preset::kDrift, Ieee14Options::Preset::kRealistic}) {
    const bool is_drift = preset == Ieee14Options::Preset::kDrift;
    Ieee14Options network;
    network.preset = preset;
    Case scene;
    scene.model = make_ieee14_model(network);
    scene.options.start.std = {0.1};
    scene.attack = Eigen::Vector2d(0.2, 0.1);
    scene.steps = 100;
    scene.first_attacked = 50;
    scene.last_attacked = 100;
    scene.delivery_probability = 0.95;
    auto result = figures(scene, {{"angles", 0, 5}, {"frequencies", 5, 5}},
                          {When::kAttacked, When::kAttacked}, 100);
    check(result["angles"], is_drift ? 0.0210 : 0.0274, 0.0003, 1e-4);
    check(result["frequencies"], is_drift ? 0.0813 : 0.0560, is_drift ? 0.0007 : 0.0005, 1e-4);
  }
}
