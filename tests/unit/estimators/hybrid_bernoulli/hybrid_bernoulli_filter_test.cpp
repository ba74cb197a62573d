#include "estimators/hybrid_bernoulli_filter.h"

#include <limits>

#include "common/random_stream.h"
#include "tests/unit/estimators/hybrid_bernoulli/golden_hbf.h"

using namespace holdfast;
using testing::largest_error;
using Options = HybridBernoulliOptions;
using Rows = std::vector<std::vector<int>>;

namespace {

enum class Through { kDirect, kPartly, kDelayed };

// n = 3, m = 2, l = 4; rows 0, 1 and rows 2, 3 have independent noise.
SystemModel small_model(Through through) {
  SystemModel model;
  model.A.resize(3, 3);
  model.A << 0.9, 0.2, 0.0, -0.1, 0.8, 0.3, 0.0, 0.1, 0.7;
  model.C.resize(4, 3);
  model.C << 1.0, 0.0, 0.0, 0.0, 1.0, 0.2, 0.3, 0.0, 1.0, 1.0, -1.0, 0.5;
  model.G.resize(3, 2);
  model.G << 1.0, 0.0, 0.2, 0.7, 0.0, 1.0;
  model.H.setZero(4, 2);
  if (through == Through::kDirect) model.H << 1.0, 0.0, 0.0, 1.0, 0.5, 0.5, 0.0, 0.0;
  if (through == Through::kPartly) model.H << 1.0, 0.5, 0.0, 0.0, 2.0, 1.0, 0.0, 0.0;
  model.Q = 0.05 * Eigen::MatrixXd::Identity(3, 3);
  model.R.setZero(4, 4);
  model.R << 0.1, 0.03, 0.0, 0.0, 0.03, 0.2, 0.0, 0.0, 0.0, 0.0, 0.15, -0.02, 0.0, 0.0, -0.02, 0.1;
  return model;
}

Options small_options() {
  Options options;
  options.birth_probability = 0.2;
  options.survival_probability = 0.7;
  options.delivery_probability = 0.9;
  AttackModel attack;
  attack.channels = {0, 1};
  attack.terms.push_back({1.0, Eigen::Vector2d(0.5, -0.2), 4.0 * Eigen::Matrix2d::Identity()});
  options.attack_models = {attack};
  options.prune_below = 1e-6;
  return options;
}

void add(MeasurementSet& set, int source, const std::vector<double>& values) {
  Packet packet;
  packet.source = source;
  packet.rx_index = static_cast<std::int64_t>(set.packets.size());
  set.add(packet, values);
}

std::vector<double> draw(const RandomStream& stream, std::uint32_t k, std::uint32_t p, int size) {
  std::vector<double> y;
  for (int i = 0; i < size; ++i) {
    y.push_back(stream.normal(k, 16 * p + static_cast<std::uint32_t>(i)));
  }
  return y;
}

// Sets of k % 4 packets.
std::vector<MeasurementSet> drawn_sets(std::uint32_t steps) {
  const RandomStream stream(1, 0, "test/packets");
  std::vector<MeasurementSet> sets(steps);
  for (std::uint32_t k = 0; k < steps; ++k) {
    sets[k].clear(k + 1, 0);
    for (std::uint32_t p = 0; p < k % 4; ++p) add(sets[k], 0, draw(stream, k, p, 4));
  }
  return sets;
}

// The same plant through the functions of a nonlinear one.
SystemModel as_functions(SystemModel model) {
  const SystemModel linear = model;
  model.transition = [linear](const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                              Eigen::VectorXd& next) { linear.move(x, a, next); };
  model.measurement = [linear](const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                               Eigen::VectorXd& y) { linear.measure(x, a, y); };
  model.transition_jacobian = [linear](const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                                       Eigen::MatrixXd& F) { linear.move_jacobian(x, a, F); };
  model.measurement_jacobian = [linear](const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                                        Eigen::MatrixXd& J) { linear.measure_jacobian(x, a, J); };
  return model;
}

double estimate_error(const Estimate& made, const Estimate& wanted) {
  return std::max({largest_error(made.attack_probability, wanted.attack_probability),
                   largest_error(made.mean, wanted.mean),
                   largest_error(made.covariance, wanted.covariance),
                   largest_error(made.input_mean, wanted.input_mean),
                   largest_error(made.hypotheses[1].mean, wanted.hypotheses[1].mean),
                   largest_error(made.hypotheses[0].covariance, wanted.hypotheses[0].covariance)});
}

}  // namespace

TEST_CASE("extended and unscented updates are the linear one on linear models") {
  for (const Through through : {Through::kDirect, Through::kPartly, Through::kDelayed}) {
    const SystemModel linear = small_model(through);
    for (const Options::Update update : {Options::Update::kExtended, Options::Update::kUnscented}) {
      Options options = small_options();
      options.update = update;
      HybridBernoulliFilter reference(linear, options, testing::all_rows(linear));
      HybridBernoulliFilter filter(as_functions(linear), options, testing::all_rows(linear));
      std::int64_t step = 0;
      for (const MeasurementSet& set : drawn_sets(12)) {
        ++step;
        const Estimate wanted = reference.step(step, set, {});
        CHECK(estimate_error(filter.step(step, set, {}), wanted) < 1e-10);
      }
    }
  }
}

TEST_CASE("packets that no filter can use are refused and counted, and change nothing") {
  const SystemModel model = small_model(Through::kDirect);
  HybridBernoulliFilter filter(model, small_options(), testing::all_rows(model));
  HybridBernoulliFilter reference(model, small_options(), testing::all_rows(model));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  std::int64_t step = 0;
  for (const MeasurementSet& set : drawn_sets(6)) {
    ++step;
    const Estimate wanted = reference.step(step, set, {});
    MeasurementSet spoiled;
    spoiled.clear(step, 0);
    add(spoiled, 0, {nan, 0.0, 0.0, 0.0});
    for (const Packet& packet : set.packets) {
      const auto values = set.values_of(packet);
      add(spoiled, 0, {values.begin(), values.end()});
    }
    add(spoiled, 0, {0.0, 0.0, 0.0, -infinity});
    add(spoiled, 0, {0.0, 1e200, 0.0, 0.0});
    add(spoiled, 0, {0.0, 0.0, 0.0});
    add(spoiled, 7, {0.0, 0.0, 0.0, 0.0});
    add(spoiled, -1, {0.0, 0.0, 0.0, 0.0});
    const Estimate& made = filter.step(step, spoiled, {});
    CHECK(made.outcome == StepOutcome::kRefusedInput);
    CHECK(estimate_error(made, wanted) == 0.0);
    CHECK(filter.refused_packets() == 6 * step);
    CHECK(made.packet_probability.size() == spoiled.packets.size());
    CHECK(made.packet_probability.front() == 0.0);
  }
}

TEST_CASE("five hundred packets in a step leave a bounded, finite belief") {
  const SystemModel model = small_model(Through::kDirect);
  Options options = small_options();
  options.prune_below = 0.0;
  options.components_max = 50;
  HybridBernoulliFilter filter(model, options, testing::all_rows(model));
  const RandomStream stream(1, 0, "test/flood");
  for (std::uint32_t k = 1; k <= 2; ++k) {
    MeasurementSet flood;
    flood.clear(k, 0);
    for (std::uint32_t p = 0; p < 500; ++p) add(flood, 0, draw(stream, k, p, 4));
    const Estimate& estimate = filter.step(k, flood, {});
    CHECK(filter.p0().size() <= 50);
    CHECK(filter.p1().size() <= 50);
    CHECK(estimate.mean.allFinite());
    CHECK(estimate.covariance.allFinite());
    double sum = 0.0;
    for (const double probability : estimate.packet_probability) sum += probability;
    CHECK(sum <= 1.0 + 1e-9);
    CHECK(sum > 0.5);
  }
}

TEST_CASE("a false set far away, or none at all, leaves the prediction") {
  const SystemModel model = small_model(Through::kDirect);
  HybridBernoulliFilter filter(model, small_options(), testing::all_rows(model));
  MeasurementSet far, none;
  far.clear(1, 0);
  add(far, 0, {1e90, -1e90, 1e90, 1e90});
  const Estimate& estimate = filter.step(1, far, {});
  CHECK(estimate.attack_probability == Approx(small_options().start_attack_probability));
  CHECK(estimate.packet_probability.at(0) == 0.0);
  const double r = estimate.attack_probability;
  filter.step(2, none, {});
  CHECK(filter.attack_probability() == Approx(0.2 * (1.0 - r) + 0.7 * r).epsilon(1e-13));
}

TEST_CASE("packets in another order give the same belief") {
  const SystemModel model = small_model(Through::kDelayed);
  HybridBernoulliFilter filter(model, small_options(), testing::all_rows(model));
  HybridBernoulliFilter turned(model, small_options(), testing::all_rows(model));
  std::int64_t step = 0;
  for (const MeasurementSet& set : drawn_sets(8)) {
    MeasurementSet reversed;
    reversed.clear(++step, 0);
    for (auto packet = set.packets.rbegin(); packet != set.packets.rend(); ++packet) {
      const auto values = set.values_of(*packet);
      add(reversed, 0, {values.begin(), values.end()});
    }
    const Estimate wanted = filter.step(step, set, {});
    const Estimate& made = turned.step(step, reversed, {});
    CHECK(estimate_error(made, wanted) < 1e-10);
    for (std::size_t p = 0; p < set.packets.size(); ++p) {
      CHECK(made.packet_probability[set.packets.size() - 1 - p] ==
            Approx(wanted.packet_probability[p]).margin(1e-12));
    }
  }
}

TEST_CASE("attack models that are drawn anew are the terms of one, with a name") {
  const SystemModel model = small_model(Through::kDirect);
  Options named = small_options(), single = small_options();
  // Merging never joins models, so that it would tell the two apart.
  named.merge_below = single.merge_below = 0.0;
  named.prune_below = single.prune_below = 0.0;
  named.components_max = single.components_max = 4000;
  AttackTerm wide{1.0, Eigen::Vector2d(-1.0, 1.0), 9.0 * Eigen::Matrix2d::Identity()};
  named.attack_models.push_back({"wide", 3.0, {0, 1}, {wide}});
  single.attack_models[0].terms.push_back(wide);
  single.attack_models[0].terms[1].weight = 3.0;
  HybridBernoulliFilter filter(model, named, testing::all_rows(model));
  HybridBernoulliFilter reference(model, single, testing::all_rows(model));
  std::int64_t step = 0;
  for (const MeasurementSet& set : drawn_sets(3)) {
    ++step;
    const Estimate wanted = reference.step(step, set, {});
    const Estimate& made = filter.step(step, set, {});
    CHECK(estimate_error(made, wanted) < 1e-12);
    REQUIRE(made.mode_probability.size() == 2);
    CHECK(made.mode_probability[0] + made.mode_probability[1] == Approx(1.0));
  }
}

TEST_CASE("the model that drives the hit channel alone is found") {
  const SystemModel model = small_model(Through::kDirect);
  Options options = small_options();
  const auto one = [](int channel) {
    AttackModel attack;
    attack.channels = {channel};
    attack.terms.push_back({1.0, Eigen::VectorXd::Zero(1), Eigen::MatrixXd::Constant(1, 1, 25.0)});
    return attack;
  };
  options.attack_models = {one(0), one(1)};
  options.attack_model_persistence = 0.9;
  for (const int hit : {0, 1}) {
    HybridBernoulliFilter filter(model, options, testing::all_rows(model));
    Eigen::VectorXd x = Eigen::VectorXd::Zero(3), a = Eigen::VectorXd::Zero(2), next(3), y(4);
    a[hit] = 6.0;
    for (std::int64_t k = 1; k <= 4; ++k) {
      model.measure(x, a, y);
      MeasurementSet set;
      set.clear(k, 0);
      add(set, 0, {y.data(), y.data() + 4});
      const Estimate& estimate = filter.step(k, set, {});
      CHECK(estimate.attack_probability > 0.99);
      CHECK(estimate.mode_probability[static_cast<std::size_t>(hit)] > 0.99);
      CHECK(estimate.input_mean[1 - hit] == 0.0);
      model.move(x, a, next);
      x = next;
    }
  }
}
