#include "tools/sweep.h"

#include "tests/support/catch.h"
#include "tests/unit/tools/experiment/scenario_texts.h"
#include "tools/campaign/campaign_plan.h"

namespace holdfast {
namespace {

using Points = std::vector<std::vector<std::string>>;

}  // namespace

TEST_CASE("a grid is every combination, the last key fastest; listed points follow") {
  const Sweep sweep{{parse_sweep_axis("a.b=1, 2"), parse_sweep_axis("c=[x, y],[z]")},
                    {parse_sweep_point("a.b=3; c=[w]")}};
  CHECK(sweep.points() == Points{{"a.b=1", "c=[x, y]"},
                                 {"a.b=1", "c=[z]"},
                                 {"a.b=2", "c=[x, y]"},
                                 {"a.b=2", "c=[z]"},
                                 {"a.b=3", "c=[w]"}});
  CHECK(Sweep{}.points() == Points{{}});
}

TEST_CASE("a sweep stands in the scenario, or on the command line instead") {
  const std::string in_scenario =
      "campaign.sweep={grid: {attacks.flip.probability: [0, 0.1]}, list: [{steps: 7, "
      "attacks.flip.probability: 0.3}]}";
  const CampaignPlan plan =
      load_campaign_plan(testing::scenario("binary_tracking"), {in_scenario}, {});
  REQUIRE(plan.points.size() == 3);
  CHECK(plan.points[1].experiment.rules[0].probability == 0.1);
  CHECK(plan.points[2].experiment.num_steps == 7);
  const CampaignPlan other = load_campaign_plan(testing::scenario("binary_tracking"), {in_scenario},
                                                {{parse_sweep_axis("steps=5,6,7,8")}, {}});
  CHECK(other.points.size() == 4);
}

TEST_CASE("a believed value that is the same as the true one moves with the sweep") {
  const CampaignPlan plan =
      load_campaign_plan(testing::scenario("binary_tracking"), {},
                         {{parse_sweep_axis("attacks.flip.probability=0,0.4")}, {}});
  const auto assumed = [](const CampaignPlan& of, std::size_t point) {
    const EstimatorEntry& entry = of.points[point].experiment.estimators[0];
    return entry.make.target<SecureParticleFilterMaker>()->assumes;
  };
  CHECK(assumed(plan, 0).flip[0] == 0.0);
  CHECK(assumed(plan, 1).flip[0] == 0.4);
}

TEST_CASE("a wrong sweep says which point and why") {
  const auto problem = [](const std::vector<std::string>& overrides, const Sweep& sweep) {
    try {
      load_campaign_plan(testing::scenario("binary_tracking"), overrides, sweep);
    } catch (const UsageError& error) {
      return std::string(error.what());
    }
    return std::string("none");
  };
  using Catch::Contains;
  CHECK_THAT(problem({}, {{parse_sweep_axis("attacks.flip.probability=0.1,1.5")}, {}}),
             Contains("attacks.flip.probability=1.5") && Contains("[0, 1]"));
  CHECK_THAT(problem({}, {{parse_sweep_axis("nowhere=1")}, {}}), Contains("unknown key"));
  CHECK_THAT(problem({}, {{parse_sweep_axis("seed=1,2")}, {}}), Contains("--runs"));
  const Sweep twice{{parse_sweep_axis("steps=1,2"), parse_sweep_axis("steps=3")}, {}};
  CHECK_THAT(problem({}, twice), Contains("steps is set twice"));
  for (const char* key : {"campaign.runs=3,4", "name=a,b", "description=a,b"})
    CHECK_THAT(problem({}, {{parse_sweep_axis(key)}, {}}), Contains("changes no run"));
  CHECK_THAT(problem({"campaign.sweep={grid: {steps: [1, null]}}"}, {}), Contains("empty value"));
  CHECK_THAT(problem({"campaign.sweep={grid: [1, 2]}"}, {}), Contains("campaign.sweep.grid"));
  CHECK_THAT(problem({"campaign.sweep={lists: []}"}, {}), Contains("unknown key"));
  for (const char* text : {"", "a", "=1", "a=", "a=[", "a=1,[2", "a=1,,2", "a=~", "a=1,2,1"})
    CHECK_THROWS_AS(parse_sweep_axis(text), UsageError);
  for (const char* text : {"", ";", "a", "=1", "a=1; b"})
    CHECK_THROWS_AS(parse_sweep_point(text), UsageError);
}

}  // namespace holdfast
