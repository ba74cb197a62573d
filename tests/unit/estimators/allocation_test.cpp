#include "estimators/secure_particle_filter.h"
#include "tests/support/allocation_count.h"
#include "tests/unit/estimators/golden_binary_pf.h"

using namespace holdfast;
using Options = SecureParticleFilterOptions;

TEST_CASE("a step allocates nothing once the filter has seen the largest set") {
  const BinaryTargetModel model = testing::grid_model(true);
  const Eigen::VectorXd no_input;
  std::vector<Options> variants(5);
  variants[1].likelihood = Options::Likelihood::kTable;
  variants[2].resampling = Options::Resampling::kMultinomial;
  variants[2].resample_below = 0.5;
  variants[3].proposal = Options::Proposal::kAuxiliary;
  variants[4].duplicates = DuplicateRule::kProduct;
  for (const bool is_neglecting : {false, true}) {
    for (const Options& options : variants) {
      SecureParticleFilter filter(
          model, is_neglecting ? BinaryTargetModel::Attack{} : testing::table_attack(), options, 1,
          0, "pf");
      MeasurementSet largest, smaller, empty;
      for (int s = 0; s < 16; ++s) {
        testing::add_packet(largest, s, 0.03 * s);
        testing::add_packet(smaller, s, 0.5 - 0.03 * s);
      }
      testing::add_packet(largest, 3, 0.5);
      testing::add_packet(largest, 99, 0.5);
      filter.step(1, largest, no_input);
      const std::int64_t before = testing::allocation_count();
      for (std::int64_t k = 2; k < 40; ++k) {
        filter.step(k, k % 7 == 0 ? empty : k % 2 == 0 ? largest : smaller, no_input);
      }
      CHECK(testing::allocation_count() == before);
    }
  }
  const std::int64_t before = testing::allocation_count();
  const Options one;
  const SecureParticleFilter counted_one(model, {}, one, 1, 0, "pf");
  CHECK(testing::allocation_count() > before);  // negative control: the counter counts
}
