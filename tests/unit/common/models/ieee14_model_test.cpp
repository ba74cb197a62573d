#include "common/models/ieee14/ieee14_model.h"

#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "common/errors.h"
#include "tests/support/catch.h"

using namespace holdfast;
using Preset = Ieee14Options::Preset;

namespace {

nlohmann::json golden() {
  std::ifstream stream(std::string(HOLDFAST_SOURCE_DIR) + "/tests/golden/hbf/ieee14_matrices.json");
  REQUIRE(stream.good());
  return nlohmann::json::parse(stream);
}

Eigen::MatrixXd matrix_of(const nlohmann::json& rows) {
  Eigen::MatrixXd matrix(rows.size(), rows.at(0).size());
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) matrix(i, j) = rows.at(i).at(j);
  }
  return matrix;
}

double largest_difference(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  REQUIRE(a.rows() == b.rows());
  REQUIRE(a.cols() == b.cols());
  return (a - b).cwiseAbs().maxCoeff();
}

// State at k = 100 from rest, a = [0.2, 0.1] acting on steps 50 to 99.
Eigen::VectorXd attack_response(const SystemModel& model) {
  Eigen::VectorXd x = Eigen::VectorXd::Zero(10), next = x;
  const Eigen::VectorXd attack = Eigen::Vector2d(0.2, 0.1), none = Eigen::Vector2d::Zero();
  for (int k = 1; k < 100; ++k) {
    model.move(x, k >= 50 ? attack : none, next);
    x = next;
  }
  return x;
}

Ieee14Options options_of(Preset preset, bool nonlinear = false) {
  Ieee14Options options;
  options.preset = preset;
  options.nonlinear = nonlinear;
  return options;
}

}  // namespace

TEST_CASE("the Kron reduction is that of the golden file") {
  const nlohmann::json file = golden();
  const Ieee14Network network = ieee14_network();
  CHECK(largest_difference(network.laplacian, matrix_of(file.at("L_red"))) < 1e-14);
  CHECK(largest_difference(network.participation, matrix_of(file.at("W"))) < 1e-14);
  // Laws: a common rotation costs nothing, and every load is served.
  CHECK(network.laplacian.rowwise().sum().cwiseAbs().maxCoeff() < 1e-14);
  CHECK((network.participation.colwise().sum().array() - 1.0).abs().maxCoeff() < 1e-14);
}

TEST_CASE("both presets have the matrices of the golden file") {
  const nlohmann::json presets = golden().at("presets");
  for (const auto& [preset, name] :
       {std::pair{Preset::kDrift, "drift"}, std::pair{Preset::kRealistic, "realistic"}}) {
    const nlohmann::json& wanted = presets.at(name);
    const SystemModel model = make_ieee14_model(options_of(preset));
    CHECK(model.problems().empty());
    CHECK(model.is_linear());
    // Against the exponential in 60 digits the file's A is wrong by 15 units of rounding of its
    // largest entry (5.7 and 1.2); as much again for ours.
    const double allowed = 30.0 * std::numeric_limits<double>::epsilon() * model.A.maxCoeff();
    CHECK(largest_difference(model.A, matrix_of(wanted.at("A"))) < allowed);
    CHECK(largest_difference(model.G, matrix_of(wanted.at("G_buses_3_9"))) < allowed);
    CHECK(largest_difference(model.H, matrix_of(wanted.at("H_buses_3_9"))) < 1e-14);
    Ieee14Options one_victim = options_of(preset);
    one_victim.victims = {9};
    const SystemModel one = make_ieee14_model(one_victim);
    CHECK(largest_difference(one.G, matrix_of(wanted.at("G_bus_9"))) < allowed);
    CHECK(largest_difference(one.H, matrix_of(wanted.at("H_bus_9"))) < 1e-14);
  }
  const SystemModel drift = make_ieee14_model(options_of(Preset::kDrift));
  CHECK(largest_difference(drift.A, matrix_of(presets.at("realistic").at("A"))) > 1e-3);
}

TEST_CASE("noises are sigma_w^2 T I and sigma_v^2 I, the meters see the whole state") {
  const SystemModel model = make_ieee14_model({});
  CHECK(largest_difference(model.Q, 1e-4 * Eigen::MatrixXd::Identity(10, 10)) < 1e-18);
  CHECK(largest_difference(model.R, 1e-2 * Eigen::MatrixXd::Identity(10, 10)) < 1e-16);
  CHECK(model.C == Eigen::MatrixXd::Identity(10, 10));
  CHECK(model.state_names.at(0) == "delta_1_rad");
  CHECK(model.state_names.at(9) == "omega_5_radps");
  CHECK(model.measurement_names.size() == 10);
  CHECK(model.attack_names == std::vector<std::string>{"load_bus_3_pu", "load_bus_9_pu"});
}

TEST_CASE("the noise-free attack response is that of the method page") {
  // Table of presets: three decimals.
  Eigen::VectorXd drift(5), realistic(5);
  drift << -1.557, -1.509, -1.585, -1.475, -1.498;
  realistic << -0.169, -0.237, -0.334, -0.179, -0.139;
  const Eigen::VectorXd x = attack_response(make_ieee14_model(options_of(Preset::kDrift)));
  CHECK(largest_difference(x.head(5), drift) < 5.1e-4);
  CHECK(x.tail(5).maxCoeff() == Approx(-5.5).margin(0.051));
  CHECK(x.tail(5).minCoeff() == Approx(-6.4).margin(0.051));
  const Eigen::VectorXd r = attack_response(make_ieee14_model(options_of(Preset::kRealistic)));
  CHECK(largest_difference(r.head(5), realistic) < 5.1e-4);
  CHECK(r.tail(5).maxCoeff() == Approx(-0.51).margin(0.0051));
  CHECK(r.tail(5).minCoeff() == Approx(-1.01).margin(0.0051));
}

TEST_CASE("the nonlinear model's Jacobian at the origin is the linear model") {
  for (const Preset preset : {Preset::kDrift, Preset::kRealistic}) {
    const SystemModel linear = make_ieee14_model(options_of(preset));
    const SystemModel model = make_ieee14_model(options_of(preset, true));
    CHECK_FALSE(model.is_linear());
    Eigen::MatrixXd F(10, 12), J(10, 12);
    const Eigen::VectorXd origin = Eigen::VectorXd::Zero(10), none = Eigen::VectorXd::Zero(2);
    model.move_jacobian(origin, none, F);
    CHECK(largest_difference(F.leftCols(10), linear.A) < 1e-13);
    CHECK(largest_difference(F.rightCols(2), linear.G) < 1e-13);
    model.measure_jacobian(origin, none, J);
    CHECK(largest_difference(J.rightCols(2), linear.H) == 0.0);
    model.move_jacobian(Eigen::VectorXd::LinSpaced(10, -1.0, 1.0), none, F);
    CHECK(largest_difference(F.leftCols(10), linear.A) > 1e-4);
  }
}

TEST_CASE("a victim without a channel, or none at all, is an ordinary case") {
  Ieee14Options options;
  options.nonlinear = true;
  options.victims = {};
  const SystemModel model = make_ieee14_model(options);
  CHECK(model.problems().empty());
  CHECK(model.num_attack_channels() == 0);
  Eigen::VectorXd next(10);
  model.move(Eigen::VectorXd::Ones(10), Eigen::VectorXd(), next);
  CHECK(next.allFinite());
}

TEST_CASE("wrong options of the network are refused") {
  const auto refused = [](auto change) {
    Ieee14Options options;
    change(options);
    CHECK_THROWS_AS(make_ieee14_model(options), UsageError);
  };
  refused([](Ieee14Options& options) { options.victims = {15}; });
  refused([](Ieee14Options& options) { options.inertia_pu_s2 = {1.0, 1.0}; });
  refused([](Ieee14Options& options) { options.damping_pu_s = {1.0, 1.0, 1.0, 1.0, -1.0}; });
  refused([](Ieee14Options& options) { options.step_s = 0.0; });
  refused([](Ieee14Options& options) { options.measurement_noise_std = 0.0; });
}

TEST_CASE("options are read over the preset, and the resolved document says M and D") {
  const auto read = [](const std::string& text, std::string* resolved = nullptr) {
    ConfigurationDocument document = ConfigurationDocument::from_text(text, "test.yaml");
    ConfigurationMap map = document.root();
    Ieee14Options options;
    options.read(map);
    document.finish();
    if (resolved != nullptr) *resolved = document.resolved_text();
    return options;
  };
  std::string resolved;
  const Ieee14Options options = read("preset: realistic\nvictims: [9]\nnonlinear: true", &resolved);
  CHECK(options.preset == Preset::kRealistic);
  CHECK(options.victims == std::vector<int>{9});
  CHECK(options.inertia_pu_s2 == std::vector<double>(5, 0.0265));
  CHECK(resolved.find("0.0265") != std::string::npos);
  CHECK(read("inertia_pu_s2: [1, 2, 3, 4, 5]").inertia_pu_s2.at(4) == 5.0);
  CHECK_THROWS_AS(read("victims: [3.5]"), ConfigurationError);
  CHECK_THROWS_AS(read("victims: [15]"), ConfigurationError);
  CHECK_THROWS_AS(read("inertia_pu_s2: [1, 2]"), ConfigurationError);
  CHECK_THROWS_AS(read("preset: light"), ConfigurationError);
}
