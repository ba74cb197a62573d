// The estimator around the bank: packets in, estimates out.

#include "estimators/multiple_model.h"

#include "common/models/three_area/three_area_model.h"
#include "tests/support/catch.h"
#include "tests/support/texts.h"
#include "tests/unit/estimators/multiple_model/random_modes.h"

namespace holdfast {

using namespace testing;

namespace {

ModeSet three_areas() {
  ModeSet set;
  const ThreeAreaOptions options;
  for (const std::string& ties : options.ties) {
    set.topologies.push_back(make_three_area_model(options, ties));
    set.topology_names.push_back(ties);
    set.modes.push_back({ties, static_cast<int>(set.modes.size()), {0, 1, 2}});
  }
  return set;
}

const std::vector<std::vector<int>> kAreas = {{0, 1, 2, 9}, {3, 4, 5, 10}, {6, 7, 8, 11}};

void add_packet(MeasurementSet& set, int source, const std::vector<double>& values) {
  Packet packet;
  packet.source = source;
  packet.rx_index = static_cast<std::int64_t>(set.packets.size());
  set.add(packet, values);
}

MeasurementSet packets_of(std::int64_t step, const std::vector<int>& sources, double value) {
  MeasurementSet set;
  set.clear(step, step * 1000);
  for (const int source : sources) {
    add_packet(set, source, {value, 0.5 * value, -value, 0.1 * value});
  }
  return set;
}

}  // namespace

TEST_CASE("the three areas are those of the method page") {
  const ThreeAreaOptions options;
  const std::vector<std::pair<std::string, double>> traces = {
      {"111", 11.836816765522}, {"010", 9.850288386069}, {"001", 9.844360938755},
      {"100", 9.844342087977},  {"000", 8.851090552677}, {"011", 10.843558823002},
      {"101", 10.837618841588}, {"110", 10.843539961027}};
  for (const auto& [ties, trace] : traces) {
    INFO(ties);
    CHECK(std::abs(make_three_area_model(options, ties).A.trace() - trace) < 1e-11);
  }
  const SystemModel closed = make_three_area_model(options, "111");
  CHECK(std::abs(closed.A.norm() - 3.553691096101) < 1e-11);
  CHECK(std::abs(closed.A(0, 3) - 0.00309296876) < 1e-10);
  ThreeAreaOptions frozen;
  frozen.open_tie = ThreeAreaOptions::OpenTie::kFrozen;
  CHECK(make_three_area_model(frozen, "011").A(9, 9) == 1.0);
  CHECK_THROWS_AS(make_three_area_model(options, "12"), UsageError);
}

TEST_CASE("estimates say what the mode's filter knows, by the plant's channels") {
  Draws draws("estimator");
  ModeSet modes = ModeSet::single(random_mode(draws, 4, 4, 3, 3, 0));
  modes.modes = {{"first", 0, {0}}, {"rest", 0, {1, 2}}};
  MultipleModel estimator(modes, {}, {{0, 1, 2, 3}});
  MeasurementSet set;
  for (std::int64_t step = 1; step < 6; ++step) {
    set.clear(step, step);
    add_packet(set, 0, {0.1, 0.4, -0.3, 0.2});
    const Estimate& estimate = estimator.step(step, set, {});
    CHECK(estimate.outcome == StepOutcome::kOk);
    CHECK(estimate.mode_probability.size() == (step == 1 ? 0U : 2U));
    REQUIRE(estimate.input_mean.size() == 3);
    CHECK(estimate.input_step == step);  // H shows all inputs at once
    CHECK(estimate.hypotheses.size() == 2);
    if (step == 1) continue;
    const bool is_first = estimate.mode_probability[0] >= estimate.mode_probability[1];
    CHECK((estimate.input_mean[0] != 0.0) == is_first);
    CHECK((estimate.input_mean[1] != 0.0) == !is_first);
    CHECK(estimate.input_covariance(is_first ? 1 : 0, is_first ? 1 : 0) == 0.0);
    CHECK(std::abs(estimate.mode_probability[0] + estimate.mode_probability[1] - 1.0) < 1e-12);
    CHECK(estimate.innovation.size() == (is_first ? 3 : 2));
  }
  CHECK(estimator.step(6, set, {}).attack_probability == -1.0);  // each mode is attacked
}

TEST_CASE("a mode without channels makes the bank tell of attacks") {
  Draws draws("attack");
  ModeSet modes = ModeSet::single(random_mode(draws, 4, 4, 1, 1, 0));
  modes.modes = {{"none", 0, {}}, {"attacked", 0, {0}}};
  MultipleModelOptions options;
  options.bank.filter.likelihood = InputLikelihood::kEvidence;
  options.bank.filter.input_std = 10.0;
  const Eigen::VectorXd shift = 20.0 * modes.topologies[0].H.col(0).normalized();
  for (const bool is_attacked : {false, true}) {
    MultipleModel estimator(modes, options, {{0, 1, 2, 3}});
    MeasurementSet set;
    double probability = -1.0;
    for (std::int64_t step = 1; step < 8; ++step) {
      set.clear(step, step);
      const Eigen::VectorXd y = is_attacked ? shift : Eigen::VectorXd::Zero(4).eval();
      add_packet(set, 0, {y[0], y[1], y[2], y[3]});
      probability = estimator.step(step, set, {}).attack_probability;
    }
    CHECK((probability > 0.9) == is_attacked);
    CHECK((probability < 0.1) == !is_attacked);
  }
}

TEST_CASE("lost nodes, none at all, and broken packets: nothing is certain, nothing fails") {
  MultipleModel estimator(three_areas(), {}, kAreas);
  const Eigen::VectorXd no_input;
  double variance = 0.0;
  for (std::int64_t step = 1; step <= 30; ++step) {
    const std::vector<std::vector<int>> sources = {{0, 1, 2}, {1, 2}, {}, {0}};
    MeasurementSet set = packets_of(step, sources[static_cast<std::size_t>(step % 4)], 0.1);
    if (step % 5 == 0) add_packet(set, 0, {NAN, 0.0, 0.0, 0.0});
    const Estimate& estimate = estimator.step(step, set, no_input);
    INFO("step " << step);
    CHECK(estimate.mean.allFinite());
    CHECK(estimate.covariance.allFinite());
    CHECK(estimate.outcome != StepOutcome::kFactorisationFailed);
    // An input whose node is silent has its prior.
    if (step % 4 == 1) variance = estimate.input_covariance(0, 0);
    if (step % 4 == 1) CHECK(variance == Approx(1e8));
    if (step % 4 == 0) CHECK(estimate.input_covariance(0, 0) < 10.0);
  }
  CHECK(estimator.refused_packets() == 6);
}

TEST_CASE("a generated set has every set of channels, in every topology") {
  ModeSet modes = three_areas();
  ConfigurationDocument document = ConfigurationDocument::from_text(
      "generated_modes: {attacked_most: 2, attacked_least: 1, topologies: [\"111\", \"000\"]}",
      "test");
  ConfigurationMap root = document.root();
  modes.read(root);
  document.finish();
  REQUIRE(modes.modes.size() == 12);  // 2 (3 + 3)
  CHECK(modes.modes.front().name == "111:w_1");
  CHECK(modes.modes.back().name == "000:w_2+w_3");
  CHECK(modes.modes.back().channels == std::vector<int>{1, 2});
  CHECK(modes.model(11).H.cols() == 2);
}

TEST_CASE("modes that cannot be are told with their place") {
  const auto text_of = [](const std::string& yaml) {
    ModeSet modes = three_areas();
    ConfigurationDocument document = ConfigurationDocument::from_text(yaml, "test");
    ConfigurationMap root = document.root();
    modes.read(root);
    try {
      document.finish();
    } catch (const ConfigurationError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  CHECK(text_of("modes: [{name: a, channels: [w_4]}]").find("w_4") != std::string::npos);
  CHECK(text_of("modes: [{name: a, topology: \"22\"}]").find("topologies") != std::string::npos);
  CHECK(text_of("modes: [{name: a}, {name: a}]").find("given twice") != std::string::npos);
  CHECK(text_of("modes: []").find("at least one") != std::string::npos);
  CHECK(text_of("generated_modes: {attacked_most: 4}").find("attacked_most") != std::string::npos);
  CHECK(text_of("{modes: [{name: a}], generated_modes: {}}").find("not both") != std::string::npos);
}

TEST_CASE("the state is as far off as its covariance says, and a wrong R is found out") {
  // Mode known; NEES over runs with a random start, after the start is forgotten.
  const SystemModel model = make_three_area_model(ThreeAreaOptions(), "010");
  const RandomStream noise(1, 0, "nees");
  const std::vector<int> rows = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11};
  constexpr int kRuns = 200, kSteps = 40;
  SystemModel bold = model;
  bold.R *= 0.1;
  for (const bool is_right : {true, false}) {
    InputStateFilter filter({is_right ? model : bold}, {});
    double state_sum = 0.0, input_sum = 0.0, input_squares = 0.0, state_squares = 0.0;
    for (std::uint32_t run = 0; run < kRuns; ++run) {
      std::uint64_t draw = 0;
      const auto normals = [&](const Eigen::MatrixXd& covariance) {
        Eigen::VectorXd values(covariance.rows());
        for (Eigen::Index i = 0; i < values.size(); ++i) {
          values[i] = std::sqrt(covariance(i, i)) * noise.normal(run, draw++);
        }
        return values;
      };
      const Eigen::MatrixXd P0 = 0.1 * Eigen::MatrixXd::Identity(12, 12);
      Eigen::VectorXd x = normals(P0), d = Eigen::VectorXd::Zero(3);
      filter.start({Eigen::VectorXd::Zero(12), P0});
      for (int k = 0; k < kSteps; ++k) {
        if (k > 0) x = (model.A * x + normals(model.Q)).eval();
        d = Eigen::Vector3d(5.0, -3.0, 0.1 * k);
        const Eigen::VectorXd y = model.C * x + model.H * d + normals(model.R);
        filter.step(0, rows, y, {});
      }
      const Eigen::VectorXd e = filter.mean() - x;
      const Eigen::VectorXd f = filter.current().V1 * filter.seen_input() - d;
      const Eigen::MatrixXd V1 = filter.current().V1, Pd1 = filter.seen_input_covariance();
      const Eigen::MatrixXd P = filter.covariance(), Pd = V1 * Pd1 * V1.transpose();
      const double nees = e.dot(P.ldlt().solve(e)), input = f.dot(Pd.ldlt().solve(f));
      state_sum += nees;
      state_squares += nees * nees;
      input_sum += input;
      input_squares += input * input;
    }
    const auto deviation = [](double sum, double squares, double expected) {
      const double mean = sum / kRuns;
      return (mean - expected) / std::sqrt((squares / kRuns - mean * mean) / kRuns);
    };
    const double of_state = deviation(state_sum, state_squares, 12.0);
    const double of_input = deviation(input_sum, input_squares, 3.0);
    INFO("state " << of_state << ", input " << of_input);
    CHECK((std::abs(of_state) < 4.0) == is_right);
    CHECK((std::abs(of_input) < 4.0) == is_right);
  }
}

}  // namespace holdfast
