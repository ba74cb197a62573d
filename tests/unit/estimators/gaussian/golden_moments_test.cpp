// Moments of the attacked reading against the vectors of independent code.

#include "tests/unit/estimators/gaussian/golden_gslr.h"

namespace holdfast {
namespace {

using testing::matrix_of;
using testing::relative_difference;
using testing::statistics_of;
using testing::vector_of;

constexpr double kMomentTolerance = 1e-10;

void check_moments(const nlohmann::json& entry) {
  INFO(entry.at("name").get<std::string>());
  const nlohmann::json& theta = entry.at("theta");
  const AttackStatistics statistics = statistics_of(theta);
  const SizedAttackStatistics<Eigen::Dynamic> sized(statistics);
  const nlohmann::json& scale = entry.at("scale_moments");
  CHECK(sized.moments.c1 == Approx(scale.at("c1").get<double>()).epsilon(1e-13).margin(1e-15));
  CHECK(sized.moments.c2 == Approx(scale.at("c2").get<double>()).epsilon(1e-13).margin(1e-15));
  CHECK(sized.moments.s1 == Approx(scale.at("s1").get<double>()).epsilon(1e-13).margin(1e-15));
  CHECK(sized.moments.s2 == Approx(scale.at("s2").get<double>()).epsilon(1e-13).margin(1e-15));

  const Belief<Eigen::Dynamic> belief{vector_of(entry.at("x_pred")), matrix_of(entry.at("P_pred"))};
  const Small<Eigen::Dynamic, Eigen::Dynamic> H = matrix_of(theta.at("H"));
  const Small<Eigen::Dynamic, Eigen::Dynamic> R = matrix_of(theta.at("R"));
  Observation<Eigen::Dynamic, Eigen::Dynamic> observation;
  observe_linear(H, belief, observation);
  ReadingBelief<Eigen::Dynamic> reading;
  regress_reading(observation, R, sized, RegressionMoments::kExact, reading);
  CHECK(relative_difference(reading.mean, vector_of(entry.at("yhat"))) < kMomentTolerance);
  CHECK(relative_difference(reading.S, matrix_of(entry.at("Pyy"))) < kMomentTolerance);
  CHECK(relative_difference(reading.c * observation.Pxh.transpose(), matrix_of(entry.at("Pyx"))) <
        kMomentTolerance);
  CHECK(relative_difference(reading.c * observation.J, matrix_of(entry.at("H_plus"))) <
        kMomentTolerance);
  const Eigen::VectorXd offset = reading.mean - reading.c * observation.J * belief.mean;
  const double scale_of_y = std::max(1.0, reading.mean.cwiseAbs().maxCoeff());
  CHECK((offset - vector_of(entry.at("b_plus"))).cwiseAbs().maxCoeff() <
        kMomentTolerance * scale_of_y);
  // Omega is the difference of S and c^2 Phh there, so that its rounding is S's.
  const double scale_of_S = std::max(1e-300, reading.S.cwiseAbs().maxCoeff());
  CHECK((reading.Omega - matrix_of(entry.at("Omega"))).cwiseAbs().maxCoeff() <
        kMomentTolerance * scale_of_S);

  regress_reading(observation, R, sized, RegressionMoments::kPaper, reading);
  CHECK(relative_difference(reading.S, matrix_of(entry.at("paper").at("Pyy"))) < kMomentTolerance);
}

TEST_CASE("moments of the attacked reading: 22 systems") {
  const nlohmann::json cases = testing::golden_file("gslr/gslr_params.json").at("cases");
  CHECK(cases.size() == 22);
  for (const nlohmann::json& entry : cases) check_moments(entry);
}

TEST_CASE("moments of a radar's reading, three ways through the nonlinear function") {
  const nlohmann::json file = testing::golden_file("gslr/nonlinear.json");
  const nlohmann::json& theta = file.at("run").at("theta");
  TurningTargetOptions options;
  options.sensor = TurningTargetOptions::Sensor::kRadar;
  options.radar_position_m = file.at("run").at("radar").get<std::vector<double>>();
  const SystemModel model = make_turning_target_model(options);
  CHECK(relative_difference(model.R, matrix_of(theta.at("R"))) < 1e-15);
  const SizedAttackStatistics<2> sized(statistics_of(theta));
  for (const nlohmann::json& entry : file.at("moment_cases")) {
    const Belief<4> belief{vector_of(entry.at("x_pred")), matrix_of(entry.at("P_pred"))};
    for (const auto& [name, linearisation] :
         {std::pair{"ekf", Linearisation::kExtended}, std::pair{"ut", Linearisation::kUnscented},
          std::pair{"cubature", Linearisation::kCubature}}) {
      INFO(name);
      const nlohmann::json& wanted = entry.at(name);
      SizedModel<4, 2> sized_model(model, linearisation);
      Observation<4, 2> observation;
      sized_model.observe(belief, observation);
      CHECK(relative_difference(observation.h, vector_of(wanted.at("h_mean"))) < kMomentTolerance);
      CHECK(relative_difference(observation.Phh, matrix_of(wanted.at("Phh"))) < kMomentTolerance);
      CHECK(relative_difference(observation.Pxh.transpose(), matrix_of(wanted.at("Phx"))) <
            kMomentTolerance);
      ReadingBelief<2> reading;
      regress_reading(observation, sized_model.R(), sized, RegressionMoments::kExact, reading);
      CHECK(relative_difference(reading.mean, vector_of(wanted.at("yhat"))) < kMomentTolerance);
      CHECK(relative_difference(reading.S, matrix_of(wanted.at("Pyy"))) < kMomentTolerance);
      CHECK(relative_difference(reading.c * observation.Pxh.transpose(),
                                matrix_of(wanted.at("Pyx"))) < kMomentTolerance);
    }
  }
}

}  // namespace
}  // namespace holdfast
