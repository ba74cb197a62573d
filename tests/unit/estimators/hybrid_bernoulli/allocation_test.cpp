#include "estimators/hybrid_bernoulli_filter.h"
#include "tests/support/allocation_count.h"
#include "tests/unit/estimators/hybrid_bernoulli/golden_hbf.h"

using namespace holdfast;
using Options = HybridBernoulliOptions;

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
