#include "tools/campaign/campaign.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "tests/support/catch.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/tools/experiment/scenario_texts.h"
#include "tools/campaign/campaign_figures.h"
#include "tools/campaign/campaign_summary.h"
#include "tools/campaign/campaign_table.h"
#include "tools/log_review.h"
#include "tools/run_log.h"
#include "tools/simulation.h"

namespace holdfast {
namespace {

CampaignPlan small_plan(std::vector<std::string> overrides = {}, const Sweep& sweep = {}) {
  overrides.insert(overrides.begin(),
                   {"steps=15", "estimators.secure.particles=100",
                    "estimators.neglect.particles=100", "estimators.uncorrupted.particles=100"});
  CampaignPlan plan = load_campaign_plan(testing::scenario("binary_tracking"), overrides, sweep);
  plan.num_runs = 12;
  return plan;
}

void run(const CampaignPlan& plan, CampaignStore& store, int num_threads) {
  ProcessGroup group;
  CampaignOptions options;
  options.num_threads = num_threads;
  run_campaign(plan, store, group, options);
}

std::string aggregate(const CampaignPlan& plan, int num_threads) {
  CampaignStore store(":memory:", plan);
  run(plan, store, num_threads);
  return to_json(summarise(store, {}));
}

const Sweep kFlips{{{"attacks.flip.probability", {"0", "0.2"}}}, {}};

}  // namespace

TEST_CASE("a sweep's figure has every metric and estimator, by rising x") {
  // Point 0 has no attacked packet, so no area under the curve: the metric must not be lost by it.
  const CampaignPlan plan =
      small_plan({}, {{{"attacks.flip.probability", {"0.2", "0", "0.1"}}}, {}});
  CampaignStore store(":memory:", plan);
  run(plan, store, 2);
  const CampaignSummary summary = summarise(store, {});
  const Report report = campaign_report(summary);
  const auto figure = [&report](const std::string& name) {
    return std::find_if(report.figures.begin(), report.figures.end(),
                        [&name](const Figure& f) { return f.name == name; });
  };
  REQUIRE(figure("sweep_auc_packets") != report.figures.end());
  CHECK(figure("sweep_auc_packets")->series.at(0).x == std::vector<double>{0.1, 0.2});
  const auto rmse = figure("sweep_rmse_step_mean_position");
  REQUIRE(rmse != report.figures.end());
  CHECK(rmse->series.size() == 3);
  CHECK(rmse->series[0].x == std::vector<double>{0.0, 0.1, 0.2});
  CHECK(rmse->x_label == "attacks.flip.probability");
  CHECK(figure("sweep_nees_mean")->has_log_y);
  CHECK(comparison_table(summary.points).rows.size() == 18);  // points x estimators x groups
}

TEST_CASE("text from a results file is shown as text") {
  const CampaignPlan plan =
      small_plan({"state_groups=[{name: position, states: [0, 2], unit: \"=\\e[31m,m\"}]"});
  CampaignStore store(":memory:", plan);
  run(plan, store, 2);
  const CampaignSummary summary = summarise(store, {});
  for (const std::string& text : {to_text(summary), to_csv(summary), curves_to_csv(summary)})
    CHECK(text.find('\x1b') == std::string::npos);
  CHECK(to_csv(summary).find("\"'=") != std::string::npos);  // no formula, and quoted
}

TEST_CASE("a campaign gives the same bytes on any number of threads") {
  const CampaignPlan plan = small_plan({}, kFlips);
  const std::string one = aggregate(plan, 1);
  CHECK(one == aggregate(plan, 3));
  // Negative control: other runs are other numbers.
  CampaignPlan others = plan;
  others.first_run = 100;
  CHECK(one != aggregate(others, 1));
}

TEST_CASE("a campaign's curve is the root mean square over runs, done by hand") {
  const CampaignPlan plan = small_plan();
  CampaignStore store(":memory:", plan);
  run(plan, store, 2);
  const CampaignSummary summary = summarise(store, {});
  std::vector<double> sum(15, 0.0);
  for (std::uint32_t r = 0; r < 12; ++r) {
    Simulation simulation(plan.points[0].experiment, r);
    for (std::size_t k = 0; simulation.advance(); ++k) {
      const Eigen::VectorXd error = simulation.estimates()[0]->mean - simulation.truth().state;
      sum[k] += error[0] * error[0] + error[2] * error[2];
    }
  }
  const MetricCurve* curve =
      find_curve(summary.points[0].estimators[0].metrics, "rmse_over_runs", "position");
  REQUIRE(curve != nullptr);
  for (std::size_t k = 0; k < sum.size(); ++k)
    CHECK(curve->value[k] == Approx(std::sqrt(sum[k] / 12.0)).epsilon(1e-12));
}

TEST_CASE("a campaign that was interrupted goes on, and shards merge, to the same bytes") {
  const testing::TemporaryFolder folder;
  const CampaignPlan plan = small_plan({}, kFlips);
  const std::string whole = aggregate(plan, 2);
  const std::string file = folder.file("resumed.sqlite");
  for (const std::int64_t runs : {5, 5, 12}) {
    CampaignPlan part = plan;
    part.num_runs = runs;
    CampaignStore store(file, part);
    run(part, store, 2);
    CHECK(store.runs().size() == static_cast<std::size_t>(2 * runs));
  }
  CampaignStore resumed(file);
  CHECK(to_json(summarise(resumed, {})) == whole);

  std::vector<std::string> parts;
  for (int shard = 1; shard <= 3; ++shard) {
    CampaignPlan part = plan;
    part.shard = shard;
    part.num_shards = 3;
    parts.push_back(folder.file("shard" + std::to_string(shard)));
    CampaignStore store(parts.back(), part);
    run(part, store, 1);
  }
  parts.push_back(parts.front());  // twice the same run is once
  merge_campaigns(parts, folder.file("merged"));
  CampaignStore merged(folder.file("merged"));
  CHECK(to_json(summarise(merged, {})) == whole);
  CHECK_THROWS_AS(merge_campaigns(parts, folder.file("merged")), UsageError);
}

TEST_CASE("what was not committed is not there, and what was is whole") {
  const testing::TemporaryFolder folder;
  const CampaignPlan plan = small_plan();
  const std::string file = folder.file("cut.sqlite");
  {
    CampaignStore store(file, plan);
    store.add(simulate_run(plan.points[0].experiment, 0, 3));
    store.commit();
    store.add(simulate_run(plan.points[0].experiment, 0, 4));
  }
  CampaignStore store(file);
  CHECK(store.runs() == std::set<std::pair<std::int64_t, std::int64_t>>{{0, 3}});
}

TEST_CASE("a results file takes no other campaign, and no other result for a run") {
  const testing::TemporaryFolder folder;
  const std::string file = folder.file("results.sqlite");
  const CampaignPlan plan = small_plan();
  RunResult result = simulate_run(plan.points[0].experiment, 0, 0);
  {
    CampaignStore store(file, plan);
    store.add(result);
    store.add(result);
    result.estimators[0].scores.curves.begin()->second[3] += 1e-9;
    CHECK_THROWS_AS(store.add(result), JobError);
    CHECK_THROWS_AS(CampaignStore(file, plan), JobError);  // in use
    store.commit();
  }
  CHECK_THROWS_AS(CampaignStore(file, small_plan({"plant.attack.dos=0.3"})), UsageError);
  CHECK_NOTHROW(CampaignStore(file, plan));
  CHECK_THROWS_AS(CampaignStore(testing::scenario("binary_tracking")), UsageError);
  CHECK_THROWS_AS(CampaignStore(folder.file("missing")), UsageError);
}

TEST_CASE("a campaign says of one run what the review says of its log") {
  const testing::TemporaryFolder folder;
  const bool has_vectors = GENERATE(false, true);
  const std::string network = std::string(HOLDFAST_SOURCE_DIR) + "/scenarios/ieee14.yaml";
  CampaignPlan plan = has_vectors
                          ? load_campaign_plan(network, {"steps=60", "campaign.windows=[]"}, {})
                          : small_plan();
  plan.first_run = 5;
  plan.num_runs = 1;
  CampaignStore store(":memory:", plan);
  run(plan, store, 1);
  const CampaignSummary summary = summarise(store, {});
  write_run_log(plan.points[0].experiment, 5, folder.file("run.lcm"));
  const RunReview review = review_log(folder.file("run.lcm"));
  REQUIRE(review.estimators.size() == summary.points[0].estimators.size());
  for (std::size_t i = 0; i < review.estimators.size(); ++i) {
    const EstimatorMetrics& ours = summary.points[0].estimators[i].metrics;
    const EstimatorMetrics& logged = review.estimators[i].metrics;
    CHECK(ours.estimator == logged.estimator);
    REQUIRE(ours.metrics.size() == logged.metrics.size());
    for (std::size_t m = 0; m < ours.metrics.size(); ++m) {
      INFO(ours.estimator << " " << ours.metrics[m].name);
      CHECK(ours.metrics[m].name == logged.metrics[m].name);
      CHECK(ours.metrics[m].group == logged.metrics[m].group);
      CHECK(ours.metrics[m].value == logged.metrics[m].value);  // to the bit
    }
  }
  CHECK(find_metric(summary.points[0].estimators[0].metrics, "auc_packets") != nullptr);
}

TEST_CASE("a run's result survives its bytes") {
  const CampaignPlan plan = small_plan();
  const RunResult result = simulate_run(plan.points[0].experiment, 0, 7);
  REQUIRE(result.estimators.size() == 3);
  const std::vector<std::uint8_t> bytes = to_bytes(result);
  CHECK(to_bytes(run_result_from(bytes)) == bytes);
  CHECK_THROWS_AS(run_result_from(std::span(bytes).first(bytes.size() / 2)), JobError);

  CampaignStore store(":memory:", plan);
  store.add(result);
  CHECK(to_bytes(store.read_run(0, 7)) == bytes);
}

TEST_CASE("a plan survives its bytes, and another kernel is refused") {
  const CampaignPlan plan = small_plan({}, kFlips);
  const CampaignPlan copy = campaign_plan_from(to_bytes(plan));
  CHECK(copy.identity() == plan.identity());
  CHECK(aggregate(copy, 1) == aggregate(plan, 1));
}

TEST_CASE("progress reaches the end, and tells what was there before") {
  const CampaignPlan plan = small_plan();
  CampaignStore store(":memory:", plan);
  std::int64_t last = 0, earlier = -1;
  CampaignOptions options;
  options.num_threads = 3;
  options.on_progress = [&](std::int64_t done, std::int64_t before, std::int64_t all) {
    CHECK(done >= last);
    CHECK(all == 12);
    last = done;
    earlier = before;
  };
  ProcessGroup group;
  run_campaign(plan, store, group, options);
  CHECK(last == 12);
  CHECK(earlier == 0);
}

TEST_CASE("a campaign that is stopped keeps what is done") {
  const testing::TemporaryFolder folder;
  const CampaignPlan plan = small_plan();
  const std::string file = folder.file("stopped.sqlite");
  {
    CampaignStore store(file, plan);
    CampaignOptions options;
    options.num_threads = 1;
    options.should_stop = [&store] { return store.runs().size() >= 3; };
    ProcessGroup group;
    CHECK_THROWS_WITH(run_campaign(plan, store, group, options), Catch::Contains("stopped after"));
  }
  CampaignStore store(file);
  CHECK(store.runs().size() >= 3);
  CHECK(store.runs().size() < 12);
}

TEST_CASE("what throws in a run comes out of the campaign") {
  CampaignPlan plan = small_plan();
  auto& make = plan.points[0].experiment.estimators[0].make;
  make.target<SecureParticleFilterMaker>()->options.kernel = "no such kernel";
  CampaignStore store(":memory:", plan);
  CHECK_THROWS_AS(run(plan, store, 2), UsageError);
}

TEST_CASE("a campaign that would not fit into memory is refused with what to do") {
  CampaignPlan plan = small_plan();
  CHECK_NOTHROW(plan.check_size());
  plan.num_runs = 1'000'000'000;
  CHECK_THROWS_AS(plan.check_size(), UsageError);
}

TEST_CASE("estimators of one run share its random numbers: paired differences see little") {
  const CampaignPlan plan = small_plan();
  CampaignStore store(":memory:", plan);
  run(plan, store, 2);
  const PointSummary point = summarise(store, {}).points[0];
  const auto& difference = point.estimators[1].against_first;
  REQUIRE(difference.size() == 2);
  const double secure =
      find_metric(point.estimators[0].metrics, "rmse_step_mean", "position")->value;
  const double neglect =
      find_metric(point.estimators[1].metrics, "rmse_step_mean", "position")->value;
  CHECK(difference[0].value == Approx(neglect - secure).epsilon(1e-12));
}

}  // namespace holdfast
