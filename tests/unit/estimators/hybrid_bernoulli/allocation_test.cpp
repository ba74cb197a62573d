#include <cmath>

#include "common/random_stream.h"
#include "estimators/hybrid_bernoulli_filter.h"
#include "tests/support/allocation_count.h"
#include "tests/unit/estimators/hybrid_bernoulli/golden_hbf.h"

using namespace holdfast;
using Options = HybridBernoulliOptions;
using Rows = std::vector<std::vector<int>>;

namespace {

// n = 3, m = 2, l = 4; rows 0, 1 and rows 2, 3 have independent noise.
SystemModel plant(bool is_direct) {
  SystemModel model;
  model.A.resize(3, 3);
  model.A << 0.9, 0.2, 0.0, -0.1, 0.8, 0.3, 0.0, 0.1, 0.7;
  model.C.resize(4, 3);
  model.C << 1.0, 0.0, 0.0, 0.0, 1.0, 0.2, 0.3, 0.0, 1.0, 1.0, -1.0, 0.5;
  model.G.resize(3, 2);
  model.G << 1.0, 0.0, 0.2, 0.7, 0.0, 1.0;
  model.H.setZero(4, 2);
  if (is_direct) model.H << 1.0, 0.0, 0.0, 1.0, 0.5, 0.5, 0.0, 0.0;
  model.Q = 0.05 * Eigen::MatrixXd::Identity(3, 3);
  model.R.setZero(4, 4);
  model.R.diagonal() << 0.1, 0.2, 0.15, 0.1;
  model.R(0, 1) = model.R(1, 0) = 0.03;
  return model;
}

// The first state turns like a pendulum; functions that allocate nothing themselves.
SystemModel nonlinear_plant(bool is_direct) {
  const SystemModel linear = plant(is_direct);
  SystemModel model = linear;
  model.transition = [linear](const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                              Eigen::VectorXd& next) {
    linear.move(x, a, next);
    next[1] += 0.2 * std::sin(x[0]);
  };
  model.transition_jacobian = [linear](const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                                       Eigen::MatrixXd& F) {
    linear.move_jacobian(x, a, F);
    F(1, 0) += 0.2 * std::cos(x[0]);
  };
  model.measurement = [linear](const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                               Eigen::VectorXd& y) {
    linear.measure(x, a, y);
    y[0] += 0.1 * std::sin(x[1]);
  };
  model.measurement_jacobian = [linear](const Eigen::VectorXd& x, const Eigen::VectorXd& a,
                                        Eigen::MatrixXd& J) {
    linear.measure_jacobian(x, a, J);
    J(0, 1) += 0.1 * std::cos(x[1]);
  };
  return model;
}

Options usual_options() {
  Options options;
  options.birth_probability = 0.2;
  options.survival_probability = 0.7;
  options.delivery_probability = 0.9;
  options.components_max = 20;
  return options;
}

AttackModel attack_on(const std::string& name, int channel) {
  AttackModel attack;
  attack.name = name;
  attack.channels = {channel};
  attack.terms = {{0.6, Eigen::VectorXd::Constant(1, 1.0), Eigen::MatrixXd::Constant(1, 1, 4.0)},
                  {0.4, Eigen::VectorXd::Constant(1, -2.0), Eigen::MatrixXd::Constant(1, 1, 9.0)}};
  return attack;
}

// Up to two packets of each source, not always of the same ones, and none in the fourth step.
std::vector<MeasurementSet> packets_for(const Rows& rows) {
  const RandomStream stream(1, 0, "test/allocation");
  std::vector<MeasurementSet> sets(8);
  for (std::uint32_t k = 0; k < 8; ++k) {
    sets[k].clear(k + 1, 0);
    std::uint32_t draw = 0;
    for (std::uint32_t p = 0; p < 2; ++p) {
      for (std::size_t s = 0; s < rows.size(); ++s) {
        if (k == 3 || (k + p + s) % 4 == 0) continue;
        Packet packet;
        packet.source = static_cast<std::int32_t>(s);
        std::vector<double> values;
        for (std::size_t i = 0; i < rows[s].size(); ++i) values.push_back(stream.normal(k, draw++));
        sets[k].add(packet, values);
      }
    }
  }
  return sets;
}

// By one more run over the packets, when the filter has seen them twice.
std::int64_t allocations_of(const SystemModel& model, const Options& options, const Rows& rows) {
  const std::vector<MeasurementSet> sets = packets_for(rows);
  const Eigen::VectorXd no_input;
  HybridBernoulliFilter filter(model, options, rows);
  const HybridBernoulliBelief start = filter.belief();
  std::int64_t step = 0, before = 0;
  for (int run = 0; run < 3; ++run) {
    before = testing::allocation_count();
    filter.set_belief(start, true);
    for (const MeasurementSet& set : sets) filter.step(++step, set, no_input);
  }
  return testing::allocation_count() - before;
}

const Rows kAllRows = {{0, 1, 2, 3}}, kTwoNodes = {{0, 1}, {2, 3}};

}  // namespace

TEST_CASE("a step of the hybrid Bernoulli filter allocates nothing once it has seen such steps") {
  const nlohmann::json golden = testing::golden_hbf("recursion.json");
  const Eigen::VectorXd no_input;
  for (const std::size_t which : {0U, 4U, 8U}) {
    const nlohmann::json& item = golden.at("cases").at(which);
    const SystemModel system = testing::system_of(item.at("model"));
    Options options = testing::options_of(item.at("model"), item.at("kind"));
    options.prune_below = 1e-3;
    options.merge_below = 3.0;
    options.components_max = 20;
    std::vector<MeasurementSet> sets;
    for (const nlohmann::json& Z : item.at("Z")) sets.push_back(testing::packets_of(Z));
    for (const bool estimates_delivery : {false, true}) {
      if (estimates_delivery) options.delivery_prior = BetaPrior{9.0, 1.0};
      HybridBernoulliFilter filter(system, options, testing::all_rows(system));
      const HybridBernoulliBelief start = filter.belief();
      std::int64_t step = 0;
      const auto run = [&] {
        filter.set_belief(start, true);
        for (const MeasurementSet& set : sets) filter.step(++step, set, no_input);
      };
      run();
      // The mixtures of a belief change places, so that each must have seen the largest.
      run();
      const std::int64_t before = testing::allocation_count();
      run();
      CHECK(testing::allocation_count() == before);
    }
  }
  const std::int64_t before = testing::allocation_count();
  const GaussianMixture copy(HybridBernoulliBelief().p0);
  std::vector<double> counted(10);
  CHECK(testing::allocation_count() > before);  // negative control: the counter counts
  const std::int64_t before_matrix = testing::allocation_count();
  const Eigen::VectorXd matrix = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(counted.size()));
  CHECK(testing::allocation_count() > before_matrix);  // what Eigen takes, too
  CHECK(matrix.size() == 10);
}

TEST_CASE("nor does one of a nonlinear plant, by either update") {
  for (const bool is_direct : {true, false}) {
    for (const Options::Update update : {Options::Update::kExtended, Options::Update::kUnscented}) {
      Options options = usual_options();
      options.update = update;
      CHECK(allocations_of(nonlinear_plant(is_direct), options, kAllRows) == 0);
      CHECK(allocations_of(nonlinear_plant(is_direct), options, kTwoNodes) == 0);
    }
  }
}

TEST_CASE("nor does one without a prior of the signal") {
  for (const bool is_direct : {true, false}) {
    for (const Options::InputPrior prior :
         {Options::InputPrior::kFlat, Options::InputPrior::kPaper}) {
      Options options = usual_options();
      options.input_prior = prior;
      CHECK(allocations_of(plant(is_direct), options, kAllRows) == 0);
    }
  }
}

TEST_CASE("nor does one of several nodes, merged between them or not") {
  for (const bool is_direct : {true, false}) {
    for (const int components_max : {4, 200}) {
      Options options = usual_options();
      options.components_max = components_max;
      CHECK(allocations_of(plant(is_direct), options, kTwoNodes) == 0);
      CHECK(allocations_of(plant(is_direct), options, {{0, 1}, {2}, {3}}) == 0);
    }
  }
}

TEST_CASE("nor does one of several attack models with an estimated delivery probability") {
  for (const bool is_direct : {true, false}) {
    Options options = usual_options();
    options.attack_models = {attack_on("left", 0), attack_on("right", 1)};
    options.attack_model_persistence = 0.6;
    options.delivery_prior = BetaPrior{9.0, 1.0};
    options.delivery_memory = 0.98;
    CHECK(allocations_of(plant(is_direct), options, kAllRows) == 0);
    CHECK(allocations_of(plant(is_direct), options, kTwoNodes) == 0);
  }
}
