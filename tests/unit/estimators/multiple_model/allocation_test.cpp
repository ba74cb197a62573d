#include "common/models/three_area/three_area_model.h"
#include "estimators/multiple_model.h"
#include "tests/support/allocation_count.h"
#include "tests/support/catch.h"

using namespace holdfast;
using namespace holdfast::testing;

TEST_CASE("a step of the bank allocates nothing, static, dynamic or mixed, rows lost or not") {
  ModeSet modes;
  const ThreeAreaOptions plant;
  for (const std::string& ties : plant.ties) {
    modes.topologies.push_back(make_three_area_model(plant, ties));
    modes.topology_names.push_back(ties);
    modes.modes.push_back({ties, static_cast<int>(modes.modes.size()), {0, 1, 2}});
  }
  const std::vector<std::vector<int>> rows = {{0, 1, 2, 9}, {3, 4, 5, 10}, {6, 7, 8, 11}};
  const Eigen::VectorXd no_input;
  for (const bool is_dynamic : {false, true}) {
    MultipleModelOptions options;
    if (is_dynamic) {
      options.bank.transition = Eigen::MatrixXd::Constant(5, 5, 0.0025);
      options.bank.transition.diagonal().setConstant(0.99);
      options.output = MultipleModelOptions::Output::kMixture;
    }
    MultipleModel estimator(modes, options, rows);
    MeasurementSet whole, partial;
    for (MeasurementSet* set : {&whole, &partial}) {
      set->clear(1, 1);
      for (int source = set == &whole ? 0 : 1; source < 3; ++source) {
        Packet packet;
        packet.source = source;
        set->add(packet, std::vector<double>{0.1, 0.2, 0.3, 0.4});
      }
    }
    const auto step = [&](std::int64_t k) {
      estimator.step(k, k % 7 == 3 ? partial : whole, no_input);
    };
    for (std::int64_t k = 1; k < 20; ++k) step(k);
    const std::int64_t before = allocation_count();
    for (std::int64_t k = 20; k < 60; ++k) step(k);
    const std::int64_t after = allocation_count();
    INFO((is_dynamic ? "dynamic" : "static"));
    CHECK(after == before);
  }
}
