#include <Eigen/Cholesky>

#include "common/errors.h"
#include "estimators/hybrid_bernoulli_filter.h"
#include "tests/unit/estimators/hybrid_bernoulli/golden_hbf.h"

using namespace holdfast;
using testing::largest_error;
using Options = HybridBernoulliOptions;

namespace {

// n = 2, m = 2, l = 3; only the sum of both channels shows in y, each moves one state.
SystemModel partly_shown() {
  SystemModel model;
  model.A.resize(2, 2);
  model.A << 0.8, 0.3, -0.2, 0.9;
  model.C.resize(3, 2);
  model.C << 1.0, 0.0, 0.0, 1.0, 1.0, 1.0;
  model.G = Eigen::MatrixXd::Identity(2, 2);
  model.H.resize(3, 2);
  model.H << 1.0, 1.0, 0.0, 0.0, 0.5, 0.5;
  model.Q = 0.1 * Eigen::MatrixXd::Identity(2, 2);
  model.R = 0.2 * Eigen::MatrixXd::Identity(3, 3);
  return model;
}

Options always_attacked() {
  Options options;
  options.birth_probability = options.survival_probability = 1.0;
  options.delivery_probability = 1.0;
  options.start_attack_probability = 1.0;
  return options;
}

MeasurementSet set_of(int source, const Eigen::VectorXd& y) {
  MeasurementSet set;
  Packet packet;
  packet.source = source;
  set.add(packet, std::vector<double>(y.data(), y.data() + y.size()));
  return set;
}

}  // namespace

TEST_CASE("what y does not show of the signal is estimated one step later, as a batch does") {
  const SystemModel model = partly_shown();
  HybridBernoulliFilter filter(model, always_attacked(), testing::all_rows(model));
  REQUIRE(filter.layout().has_memory);
  // u = [x_1; a_1..a_3; w_1, w_2], y = M u + v.
  const Eigen::Matrix3d y = (Eigen::Matrix3d() << 1.0, 2.0, -1.0, 0.3, 0.7, 2.0, 1.5, 2.5, 0.0)
                                .finished();  // a column per step
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(9, 12), to_x = Eigen::MatrixXd::Zero(2, 12);
  Eigen::VectorXd variance = Eigen::VectorXd::Ones(12);
  variance.tail(4).setConstant(0.1);
  to_x.leftCols(2).setIdentity();
  for (int k = 0; k < 3; ++k) {
    M.middleRows(3 * k, 3) = model.C * to_x;
    M.block(3 * k, 2 + 2 * k, 3, 2) += model.H;
    to_x = (model.A * to_x).eval();
    to_x.block(0, 2 + 2 * k, 2, 2) += model.G;
    if (k < 2) to_x.block(0, 8 + 2 * k, 2, 2).setIdentity();
  }
  Estimate estimate;
  for (int k = 0; k < 3; ++k) {
    estimate = filter.step(k + 1, set_of(0, y.col(k)), {});
    const Eigen::MatrixXd seen = M.topRows(3 * k + 3);
    const Eigen::MatrixXd P = variance.asDiagonal();
    const Eigen::MatrixXd S =
        seen * P * seen.transpose() + 0.2 * Eigen::MatrixXd::Identity(seen.rows(), seen.rows());
    const Eigen::VectorXd stacked = Eigen::Map<const Eigen::VectorXd>(y.data(), seen.rows());
    const Eigen::VectorXd u = P * seen.transpose() * S.llt().solve(stacked);
    const Eigen::MatrixXd left = P - P * seen.transpose() * S.llt().solve(seen * P);
    CHECK(estimate.input_step == k);
    if (k == 0) continue;
    CHECK(largest_error(estimate.input_mean, u.segment(2 * k, 2)) < 1e-12);
    CHECK(largest_error(estimate.input_covariance, left.block(2 * k, 2 * k, 2, 2)) < 1e-12);
    CHECK(largest_error(filter.p1().mean(0).segment(2, 2), u.segment(2 * k + 2, 2)) < 1e-12);
  }
}

TEST_CASE("two nodes that carry the rows between them are one packet of all rows") {
  const SystemModel model = partly_shown();
  Options options;
  options.delivery_probability = 1.0;
  options.prune_below = 0.0;  // by the first node alone it would be another one
  HybridBernoulliFilter whole(model, options, {{0, 1, 2}});
  HybridBernoulliFilter parts(model, options, {{0, 1}, {2}});
  for (int k = 1; k <= 5; ++k) {
    const Eigen::Vector3d y(0.3 * k, 1.0 - k, 0.1);
    MeasurementSet both = set_of(1, y.tail(1));
    Packet first;
    first.source = 0;
    both.add(first, std::vector<double>(y.data(), y.data() + 2));
    const Estimate wanted = whole.step(k, set_of(0, y), {});
    const Estimate& made = parts.step(k, both, {});
    CHECK(largest_error(parts.log_odds(), whole.log_odds()) < 1e-10);
    CHECK(largest_error(made.mean, wanted.mean) < 1e-10);
    CHECK(largest_error(made.covariance, wanted.covariance) < 1e-10);
    CHECK(made.packet_probability[0] == Approx(1.0));
    CHECK(made.packet_probability[1] == Approx(1.0));
  }
}

TEST_CASE("of sources with common rows one packet at most is authentic") {
  const SystemModel model = partly_shown();
  Options options;
  options.delivery_probability = 0.999;
  HybridBernoulliFilter filter(model, options, {{0, 1, 2}, {0, 1}});
  MeasurementSet set = set_of(0, Eigen::Vector3d(0.1, 0.2, 0.3));
  Packet partial;
  partial.source = 1;
  set.add(partial, std::vector<double>{0.1, 0.2});
  const Estimate& estimate = filter.step(1, set, {});
  CHECK(estimate.packet_probability[0] + estimate.packet_probability[1] <= 1.0 + 1e-12);
  CHECK(estimate.packet_probability[1] > 1e-3);
}

TEST_CASE("rows that do not fit are refused when the filter is built") {
  SystemModel model = partly_shown();
  const Options options;
  CHECK_THROWS_AS(HybridBernoulliFilter(model, options, {}), UsageError);
  CHECK_THROWS_AS(HybridBernoulliFilter(model, options, {{}}), UsageError);
  CHECK_THROWS_AS(HybridBernoulliFilter(model, options, {{0, 3}}), UsageError);
  CHECK_THROWS_AS(HybridBernoulliFilter(model, options, {{1, 0}}), UsageError);
  model.R(0, 2) = model.R(2, 0) = 0.05;
  CHECK_NOTHROW(HybridBernoulliFilter(model, options, {{0, 1, 2}}));
  CHECK_THROWS_AS(HybridBernoulliFilter(model, options, {{0, 1}, {2}}), UsageError);
  Options flat;
  flat.input_prior = Options::InputPrior::kFlat;  // rank H = 1 < 2
  CHECK_THROWS_AS(HybridBernoulliFilter(partly_shown(), flat, {{0, 1, 2}}), UsageError);
}

TEST_CASE("an unknown delivery probability counts what arrived and what did not") {
  const SystemModel model = partly_shown();
  Options options;
  options.delivery_prior = BetaPrior{2.0, 1.0};
  HybridBernoulliFilter filter(model, options, {{0, 1, 2}});
  CHECK(filter.delivery_probability() == Approx(2.0 / 3.0));
  const MeasurementSet none;
  for (int k = 1; k <= 4; ++k) {
    filter.step(k, none, {});
    CHECK(filter.delivery_probability() == Approx(2.0 / (3.0 + k)));
  }
  // Near certain that it is the authentic one: one more delivery.
  const double before = filter.delivery_probability();
  filter.step(5, set_of(0, Eigen::Vector3d::Zero()), {});
  CHECK(filter.delivery_probability() > before);
  CHECK(filter.delivery_probability() <= Approx(3.0 / 8.0));
}

TEST_CASE("the options read from a map, and say what does not fit") {
  const SystemModel model = partly_shown();
  const auto read = [&](const std::string& text) {
    auto document = ConfigurationDocument::from_text(text, "test.yaml");
    ConfigurationMap root = document.root();
    HybridBernoulliOptions options;
    options.read(root, model);
    document.finish();
    return options;
  };
  const Options options = read(
      "birth_probability: 0.1\n"
      "delivery_probability: {alpha: 9, beta: 1}\n"
      "correction: substitution\n"
      "attack_models:\n"
      "  - {name: left, probability: 2, channels: [0], terms: [{mean: 1.0, std: 3.0}]}\n"
      "  - {name: both, terms: [{weight: 2, mean: [1, 2], covariance: [[2, 1], [1, 2]]}]}\n"
      "start: {attack_probability: 0.3, mean: 10, std: [1, 2]}\n"
      "packet_box: {low: -3, high: [1, 2, 3], outside: floor, floor: 1e-3}\n"
      "merge_metric: dominant\n");
  CHECK(options.birth_probability == 0.1);
  REQUIRE(options.delivery_prior);
  CHECK(options.delivery_prior->alpha == 9.0);
  REQUIRE(options.attack_models.size() == 2);
  CHECK(options.attack_models[0].channels == std::vector<int>{0});
  CHECK(options.attack_models[0].terms[0].covariance(0, 0) == 9.0);
  CHECK(options.attack_models[1].channels == std::vector<int>{0, 1});
  CHECK(options.attack_models[1].terms[0].covariance(0, 1) == 1.0);
  CHECK(options.start_mean[1] == 10.0);
  CHECK(options.start_covariance(1, 1) == 4.0);
  CHECK(options.packet_box_low[2] == -3.0);
  CHECK(options.packet_box_high[2] == 3.0);
  CHECK(options.outside == Options::Outside::kFloor);
  CHECK(options.problems(model).empty());

  CHECK_THROWS_AS(read("birth_probability: 1.5\n"), ConfigurationError);
  CHECK_THROWS_AS(read("pb: 0.5\n"), ConfigurationError);
  CHECK_THROWS_AS(read("attack_models: [{channels: [2]}]\n"), ConfigurationError);
  CHECK_THROWS_AS(read("attack_models: [{channels: [1, 0]}]\n"), ConfigurationError);
  CHECK_THROWS_AS(read("start: {covariance: [[1, 2], [2, 1]]}\n"), ConfigurationError);
  CHECK_THROWS_AS(read("packet_box: {low: 3, high: -3}\n"), ConfigurationError);
}
