#include "estimators/hybrid_bernoulli_filter.h"
#include "tests/unit/estimators/hybrid_bernoulli/golden_hbf.h"

using namespace holdfast;
using testing::largest_error;

TEST_CASE("whole runs with pruning, merging and capping follow the golden ones") {
  const nlohmann::json golden = testing::golden_hbf("recursion.json");
  REQUIRE(golden.at("cases").size() == 11);
  for (const nlohmann::json& item : golden.at("cases")) {
    INFO(item.at("name"));
    const SystemModel system = testing::system_of(item.at("model"));
    HybridBernoulliOptions options = testing::options_of(item.at("model"), item.at("kind"));
    options.prune_below = item.at("gamma_p");
    options.merge_below = item.at("gamma_m");
    if (!item.at("jmax").is_null()) options.components_max = item.at("jmax");
    options.merge_metric = item.at("merge_metric") == "own"
                               ? HybridBernoulliOptions::MergeMetric::kOwn
                               : HybridBernoulliOptions::MergeMetric::kDominant;
    HybridBernoulliFilter filter(system, options, testing::all_rows(system));
    filter.set_belief(testing::belief_of(item.at("initial_predicted")), true);
    const nlohmann::json& steps = item.at("steps");
    for (std::size_t k = 0; k < steps.size(); ++k) {
      INFO("step " << k + 1);
      const Estimate& estimate = filter.step(static_cast<std::int64_t>(k) + 1,
                                             testing::packets_of(item.at("Z").at(k)), {});
      REQUIRE(filter.p0().size() == steps[k].at("J0").get<int>());
      REQUIRE(filter.p1().size() == steps[k].at("J1").get<int>());
      CHECK(largest_error(filter.log_odds(), steps[k].at("log_odds").get<double>()) < 1e-8);
      CHECK(estimate.attack_probability == Approx(steps[k].at("r").get<double>()).epsilon(1e-8));
      CHECK((estimate.attack_probability > 0.5) == steps[k].at("detected").get<bool>());
      CHECK(largest_error(estimate.mean, testing::vector_of(steps[k].at("x"))) < 1e-8);
      CHECK(largest_error(estimate.input_mean, testing::vector_of(steps[k].at("a"))) < 1e-8);
    }
    const HybridBernoulliBelief last = testing::belief_of(item.at("final_posterior"));
    CHECK(testing::mixture_error(filter.p0(), last.p0, 0.0) < 1e-8);
    CHECK(testing::mixture_error(filter.p1(), last.p1, 0.0) < 1e-8);
  }
}
