#include "estimators/hybrid_bernoulli_correction.h"
#include "estimators/hybrid_bernoulli_packets.h"
#include "estimators/hybrid_bernoulli_prediction.h"
#include "tests/unit/estimators/hybrid_bernoulli/golden_hbf.h"

using namespace holdfast;
using testing::belief_of;
using testing::largest_error;

namespace {

// Prediction and correction of one golden case, every component kept.
struct SingleStep {
  SingleStep(const SystemModel& model, const HybridBernoulliOptions& wanted)
      : system(model), options(wanted.completed(model)) {
    layout.num_states = system.num_states();
    layout.num_channels = system.num_attack_channels();
    layout.is_delayed = options.feedthrough == HybridBernoulliOptions::Feedthrough::kDelayed;
  }

  HybridBernoulliBelief predict(const HybridBernoulliBelief& belief) const {
    HybridBernoulliBelief predicted = belief;
    HybridBernoulliPrediction(system, options, layout).predict(belief, predicted);
    return predicted;
  }

  HybridBernoulliBelief correct(const HybridBernoulliBelief& belief, const nlohmann::json& Z) {
    HybridBernoulliPackets packets(system, options, testing::all_rows(system));
    REQUIRE(packets.read(testing::packets_of(Z)) == 0);
    HybridBernoulliBelief corrected = belief;
    HybridBernoulliCorrection correction(system, options, layout, testing::all_rows(system));
    packet_probability.assign(Z.size(), -1.0);
    outcome = correction.correct(belief, packets.nodes().front(), corrected, packet_probability);
    return corrected;
  }

  SystemModel system;
  HybridBernoulliOptions options;
  HybridBernoulliLayout layout;
  StepOutcome outcome = StepOutcome::kOk;
  std::vector<double> packet_probability;
};

// Of what the golden triplet holds: p0 or the log odds may be left out.
double belief_error(const HybridBernoulliBelief& made, const nlohmann::json& wanted) {
  // Weights far below rounding of the others are compared as part of nothing.
  constexpr double kNegligible = 1e-13;
  double error = largest_error(made.attack_probability(), wanted.at("r").get<double>());
  if (wanted.contains("log_odds")) {
    error = std::max(error, largest_error(made.log_odds(), wanted.at("log_odds").get<double>()));
  }
  const std::pair<const char*, const GaussianMixture*> mixtures[] = {{"p0", &made.p0},
                                                                     {"p1", &made.p1}};
  for (const auto& [name, mixture] : mixtures) {
    if (!wanted.contains(name)) continue;
    const GaussianMixture goal = testing::mixture_of(wanted.at(name), -1);
    error = std::max(error, testing::mixture_error(*mixture, goal, kNegligible));
  }
  return error;
}

}  // namespace

TEST_CASE("one step predicts and corrects as the golden cases do") {
  const nlohmann::json golden = testing::golden_hbf("single_step.json");
  REQUIRE(golden.at("cases").size() == 32);
  for (const nlohmann::json& item : golden.at("cases")) {
    INFO(item.at("name"));
    const SystemModel system = testing::system_of(item.at("model"));
    SingleStep one(system, testing::options_of(item.at("model"), item.at("kind")));
    const HybridBernoulliBelief predicted = one.predict(belief_of(item.at("posterior_in")));
    CHECK(belief_error(predicted, item.at("predicted")) < 1e-10);
    const HybridBernoulliBelief corrected = one.correct(predicted, item.at("Z"));
    CHECK(one.outcome == StepOutcome::kOk);
    CHECK(belief_error(corrected, item.at("corrected_gauss")) < 1e-10);
  }
}

TEST_CASE("without a prior of the signal, and with the papers' mixed one, a step is as golden") {
  const nlohmann::json golden = testing::golden_hbf("single_step.json");
  int compared = 0;
  for (const nlohmann::json& item : golden.at("cases")) {
    if (!item.contains("log_c")) continue;
    INFO(item.at("name"));
    HybridBernoulliOptions options = testing::options_of(item.at("model"), item.at("kind"));
    options.flat_log_density = item.at("log_c");
    for (const char* prior : {"flat", "paper"}) {
      INFO(prior);
      options.input_prior = std::string(prior) == "flat"
                                ? HybridBernoulliOptions::InputPrior::kFlat
                                : HybridBernoulliOptions::InputPrior::kPaper;
      SingleStep one(testing::system_of(item.at("model")), options);
      const HybridBernoulliBelief corrected =
          one.correct(one.predict(belief_of(item.at("posterior_in"))), item.at("Z"));
      nlohmann::json wanted = item.at(std::string("corrected_") + prior);
      if (!wanted.contains("p1")) {
        // The papers' weights with the components of the flat prior.
        wanted["p1"] = item.at("corrected_flat").at("p1");
        wanted["p1"]["w"] = wanted.at("p1_w");
      }
      CHECK(belief_error(corrected, wanted) < 1e-10);
      ++compared;
    }
  }
  CHECK(compared >= 30);
}

TEST_CASE("the comparison with golden cases can fail") {
  const nlohmann::json golden = testing::golden_hbf("single_step.json");
  const nlohmann::json& item = golden.at("cases").at(1);
  nlohmann::json model = item.at("model");
  model.at("pd") = model.at("pd").get<double>() - 1e-6;
  SingleStep one(testing::system_of(model), testing::options_of(model, item.at("kind")));
  const HybridBernoulliBelief predicted = one.predict(belief_of(item.at("posterior_in")));
  CHECK(belief_error(predicted, item.at("predicted")) < 1e-10);
  CHECK(belief_error(one.correct(predicted, item.at("Z")), item.at("corrected_gauss")) > 1e-9);
}

TEST_CASE("sets that are empty, certain, far or outside the box correct as the golden cases do") {
  const nlohmann::json golden = testing::golden_hbf("edge_cases.json");
  REQUIRE(golden.at("cases").size() == 13);
  for (const nlohmann::json& item : golden.at("cases")) {
    INFO(item.at("name"));
    nlohmann::json model = golden.at("model");
    model.update(item.at("override"));
    SingleStep one(testing::system_of(model), testing::options_of(model, item.at("kind")));
    HybridBernoulliBelief belief = belief_of(golden.at("predicted"));
    belief.set_attack_probability(item.at("r_in"));
    const HybridBernoulliBelief corrected = one.correct(belief, item.at("Z"));
    CHECK(corrected.attack_probability() == Approx(item.at("r").get<double>()).epsilon(1e-10));
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
    for (const bool is_attack : {false, true}) {
      const GaussianMixture& mixture = is_attack ? corrected.p1 : corrected.p0;
      const nlohmann::json& weights = item.at(is_attack ? "p1_w" : "p0_w");
      mixture.moments(mean, covariance);
      CHECK(largest_error(mean, testing::vector_of(item.at(is_attack ? "p1_mean" : "p0_mean"))) <
            1e-10);
      std::vector<double> made, wanted;
      for (const double weight : weights) {
        if (weight > 1e-300) wanted.push_back(weight);
      }
      for (int j = 0; j < mixture.size(); ++j) {
        if (mixture.weight(j) > 1e-300) made.push_back(mixture.weight(j));
      }
      std::sort(made.begin(), made.end());
      std::sort(wanted.begin(), wanted.end());
      REQUIRE(made.size() == wanted.size());
      for (std::size_t j = 0; j < made.size(); ++j) {
        CHECK(made[j] == Approx(wanted[j]).epsilon(1e-10));
      }
    }
  }
}

TEST_CASE("the update agrees with the golden limit of ever wider priors of the signal") {
  const nlohmann::json golden = testing::golden_hbf("input_prior_limit.json");
  for (const nlohmann::json& row : golden.at("rows")) {
    const bool is_flat = row.at("Pa").is_null();
    const double Pa = is_flat ? 1.0 : row.at("Pa").get<double>();
    INFO("Pa = " << Pa << (is_flat ? ", flat" : ""));
    SystemModel system;
    system.C = testing::matrix_of(golden.at("C"));
    system.H = testing::matrix_of(golden.at("H"));
    system.R = testing::matrix_of(golden.at("R"));
    const Eigen::Index n = system.C.cols(), m = system.H.cols();
    system.A.setIdentity(n, n);
    system.Q.setIdentity(n, n);
    system.G.setZero(n, m);
    HybridBernoulliOptions options;
    options.delivery_probability = 1.0;
    options.prune_below = 0.0;
    if (is_flat) options.input_prior = HybridBernoulliOptions::InputPrior::kFlat;
    SingleStep one(system, options);
    HybridBernoulliBelief belief;
    belief.set_attack_probability(0.5);
    belief.p0 = GaussianMixture(static_cast<int>(n));
    belief.p1 = GaussianMixture(static_cast<int>(n + m));
    const Eigen::VectorXd mx = testing::vector_of(golden.at("mx"));
    const Eigen::MatrixXd Px = testing::matrix_of(golden.at("Px"));
    Eigen::VectorXd mean(n + m);
    mean << mx, testing::vector_of(golden.at("ma"));
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(n + m, n + m);
    covariance.topLeftCorner(n, n) = Px;
    covariance.bottomRightCorner(m, m) = Pa * Eigen::MatrixXd::Identity(m, m);
    belief.p0.add(0.0, mx, Px);
    belief.p1.add(0.0, mean, covariance);
    const HybridBernoulliBelief corrected =
        one.correct(belief, nlohmann::json::array({golden.at("y")}));
    // The augmented update loses digits with Pa: 1e-11 at 1e4, 1e-7 at 1e8, 1e-3 at 1e12 for R of
    // 0.1 (spec 2). The flat update loses none.
    const double bound = std::max(1e-10, 1e-14 * Pa);
    const double log_ratio =
        row.at("log_q").get<double>() - golden.at("log_q0_no_attack").get<double>();
    CHECK(largest_error(corrected.log_odds(), log_ratio) < bound);
    CHECK(largest_error(corrected.p1.mean(0), testing::vector_of(row.at("m"))) < bound);
    CHECK(largest_error(corrected.p1.covariance(0), testing::matrix_of(row.at("P"))) < bound);
  }
}
