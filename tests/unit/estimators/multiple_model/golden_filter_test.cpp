// The filter of one mode against vectors of independent code, which follows the printed algorithm
// with its pseudo-inverse.

#include <functional>

#include "tests/unit/estimators/multiple_model/golden_modes.h"

namespace holdfast {
namespace {

using namespace testing;

constexpr double kFilterTolerance = 1e-8;

struct OneRun {
  nlohmann::json file;
  std::vector<SystemModel> modes;  // one, or one for each step

  explicit OneRun(const std::string& name)
      : file(golden_file("multiple_model/alg1_" + name + ".json")) {
    const nlohmann::json& system = file.at("system");
    if (system.is_array()) {
      for (const nlohmann::json& one : system) modes.push_back(mode_of(one));
    } else {
      modes.push_back(mode_of(system));
    }
  }

  // Takes all steps; tells of each but the first.
  void take(InputStateFilter& filter,
            const std::function<void(const nlohmann::json&, const InputStateResult&)>& tell) const {
    const std::vector<int> rows = all_rows(modes.front());
    filter.start({vector_of(file.at("x0")), matrix_of(file.at("P0"))});
    for (std::size_t k = 0; k < file.at("y").size(); ++k) {
      const int mode = modes.size() > 1 ? static_cast<int>(k) : 0;
      const InputStateResult result = filter.step(mode, rows, vector_of(file.at("y").at(k)),
                                                  vector_or_none(file.at("u").at(k)));
      if (k == 0) {
        CHECK(result.kind == InputStateResult::Kind::kStarted);
        continue;
      }
      REQUIRE(result.kind == InputStateResult::Kind::kCorrected);
      INFO(file.at("name") << ", k = " << k);
      tell(file.at("steps").at(k - 1), result);
    }
  }
};

const std::vector<std::string> kRuns = {"benchmark_mode3",
                                        "benchmark_mode5",
                                        "full_column_rank_H",
                                        "kf_no_unknown_input",
                                        "no_G",
                                        "p_equals_l_rank_deficient_H",
                                        "rank2_of_3_H",
                                        "rank_deficient_H",
                                        "square_invertible_H",
                                        "three_area_mode2",
                                        "time_varying_p",
                                        "zero_H"};

void check_likelihood(const OneRun& run, InputLikelihood likelihood, const char* key) {
  InputStateRule rule;
  rule.likelihood = likelihood;
  InputStateFilter filter(run.modes, rule);
  run.take(filter, [key](const nlohmann::json& wanted, const InputStateResult& result) {
    const double value = wanted.at(key);
    INFO(key);
    CHECK(std::abs(result.log_likelihood - value) <=
          kFilterTolerance * std::max(1.0, std::abs(value)));
  });
}

}  // namespace

TEST_CASE("the filter of a mode agrees with the vectors") {
  for (const std::string& name : kRuns) {
    const OneRun run(name);
    InputStateFilter filter(run.modes, {});
    run.take(filter, [&](const nlohmann::json& wanted, const InputStateResult& result) {
      CHECK(result.rank == wanted.at("rank"));
      CHECK(difference(filter.mean(), vector_of(wanted.at("x"))) <= kFilterTolerance);
      CHECK(difference(filter.covariance(), matrix_of(wanted.at("P"))) <= kFilterTolerance);
      CHECK(difference(filter.previous_input(), vector_or_none(wanted.at("d"))) <=
            kFilterTolerance);
      const Eigen::Index p = filter.previous_input().size();
      CHECK(difference(filter.previous_input_covariance(), shaped(wanted.at("Pd"), p, p)) <=
            kFilterTolerance);
    });
  }
}

TEST_CASE("innovation and its covariance agree with the vectors in any basis") {
  for (const std::string& name : kRuns) {
    const OneRun run(name);
    InputStateFilter filter(run.modes, {});
    run.take(filter, [&](const nlohmann::json& wanted, const InputStateResult&) {
      const Eigen::MatrixXd& U2 = filter.current().U2;
      const Eigen::MatrixXd F = filter.transition().F, M2 = filter.gains().M2;
      const Eigen::MatrixXd S = filter.gains().S;
      const Eigen::MatrixXd project = Eigen::MatrixXd::Identity(S.rows(), S.rows()) - F * M2;
      const Eigen::VectorXd nu = project * filter.innovation();
      CHECK(difference(U2 * nu, vector_of(wanted.at("U2nu"))) <= kFilterTolerance);
      const Eigen::MatrixXd R2star = project * S * project.transpose();
      CHECK(difference(U2 * R2star * U2.transpose(), matrix_of(wanted.at("U2R2starU2T"))) <=
            kFilterTolerance);
    });
  }
}

TEST_CASE("all three likelihoods agree with the vectors") {
  for (const std::string& name : kRuns) {
    const OneRun run(name);
    check_likelihood(run, InputLikelihood::kPaper, "loglik");
    check_likelihood(run, InputLikelihood::kOrtho, "loglik_ortho");
    check_likelihood(run, InputLikelihood::kFlat, "loglik_flat");
  }
}

TEST_CASE("inputs improved by one more reading agree with the vectors") {
  InputStateRule rule;
  rule.improves_input = true;
  for (const std::string& name : kRuns) {
    const OneRun run(name);
    InputStateFilter filter(run.modes, rule);
    run.take(filter, [&](const nlohmann::json& wanted, const InputStateResult&) {
      CHECK(difference(filter.previous_input(), vector_or_none(wanted.at("d_smoothed"))) <=
            kFilterTolerance);
    });
  }
}

TEST_CASE("converged gains change nothing that matters") {
  for (const std::string name : {"benchmark_mode3", "benchmark_mode5", "three_area_mode2"}) {
    const OneRun run(name);
    InputStateFilter converging(run.modes, {}), exact(run.modes, {});
    exact.never_converge();
    const std::vector<int> rows = all_rows(run.modes.front());
    const auto& file = run.file;
    int num_converged = 0;
    for (std::size_t k = 0; k < 2000; ++k) {
      const std::size_t at = k % file.at("y").size();
      const Eigen::VectorXd y = vector_of(file.at("y").at(at));
      const Eigen::VectorXd u = vector_or_none(file.at("u").at(at));
      const InputStateResult one = converging.step(0, rows, y, u),
                             other = exact.step(0, rows, y, u);
      num_converged += converging.is_converged() ? 1 : 0;
      CHECK(difference(converging.mean(), exact.mean()) <= 1e-12);
      CHECK(difference(converging.covariance(), exact.covariance()) <= 1e-12);
      CHECK(std::abs(one.log_likelihood - other.log_likelihood) <=
            1e-12 * std::max(1.0, std::abs(other.log_likelihood)));
    }
    INFO(name);
    CHECK(num_converged > 1000);
    CHECK_FALSE(exact.is_converged());
  }
}

}  // namespace holdfast
