#include "tools/campaign/campaign_plan.h"

#include <nlohmann/json.hpp>
#include <set>

#include "common/run_meta.h"

namespace holdfast {
namespace {

// Keys that would make equal points, or that mean the whole campaign.
void check_settings(const std::vector<std::string>& settings) {
  std::set<std::string> keys;
  for (const std::string& setting : settings) {
    const std::string key = setting.substr(0, setting.find('='));
    if (!keys.insert(key).second) throw UsageError(key + " is set twice");
    const bool is_campaign = key.starts_with("campaign") && key != "campaign.detection_threshold";
    if (is_campaign || key == "name" || key == "description" || key == "period_s")
      throw UsageError(key + " changes no run: it cannot be swept");
  }
}

void check_point(const CampaignPoint& point, const CampaignPoint& first) {
  const auto& estimators = point.experiment.estimators;
  const bool can_run = std::any_of(estimators.begin(), estimators.end(),
                                   [](const EstimatorEntry& entry) { return !entry.is_outside(); });
  if (!can_run) throw UsageError("there is no estimator that a campaign could run");
  if (!point.experiment.plant.command.empty())
    throw UsageError("the plant is an outside command: a campaign cannot run it");
  if (point.experiment.seed != first.experiment.seed)
    throw UsageError("a sweep over the seed is what runs are for; take --runs");
}

}  // namespace

std::vector<std::pair<std::int64_t, std::int64_t>> CampaignPlan::jobs() const {
  std::vector<std::pair<std::int64_t, std::int64_t>> jobs;
  for (std::int64_t run = first_run; run < first_run + num_runs; ++run) {
    if (run % num_shards != shard - 1) continue;
    for (std::size_t point = 0; point < points.size(); ++point)
      jobs.emplace_back(static_cast<std::int64_t>(point), run);
  }
  return jobs;
}

std::string CampaignPlan::kernel_text() const {
  std::set<std::string> kernels;
  for (const CampaignPoint& point : points) kernels.insert(point.experiment.kernel_text());
  std::string text;
  for (const std::string& kernel : kernels) text += (text.empty() ? "" : "; ") + kernel;
  return text;
}

void CampaignPlan::check_size() const {
  constexpr double kBytesMax = 16e9;
  constexpr double kCurvesBesideGroups = 4.0;
  for (const CampaignPoint& point : points) {
    const Experiment& experiment = point.experiment;
    const double bytes =
        8.0 * static_cast<double>(num_runs) * static_cast<double>(experiment.num_steps) *
        static_cast<double>(experiment.scored_names().size()) *
        (static_cast<double>(experiment.state_groups.size()) + kCurvesBesideGroups);
    if (bytes > kBytesMax) {
      throw UsageError("the curves of " + std::to_string(num_runs) + " runs would take " +
                       std::to_string(static_cast<std::int64_t>(bytes * 1e-9)) +
                       " GB; take fewer --runs, or fewer steps or estimators");
    }
  }
}

std::string CampaignPlan::identity() const {
  std::string text = version_text() + "\n" + commit_text() + "\n" + kernel_text() + "\n";
  for (const CampaignPoint& point : points)
    text += sweep_label(point.settings) + "\n" + point.experiment.resolved + "\n";
  return scenario_hash(text);
}

CampaignPlan load_campaign_plan(const std::string& file, const std::vector<std::string>& overrides,
                                const Sweep& sweep) {
  CampaignPlan plan;
  const Experiment base = load_experiment(file, overrides);
  plan.scenario = base.name;
  plan.num_runs = base.campaign_runs;
  const Sweep& used = sweep.is_empty() ? base.sweep : sweep;
  for (std::vector<std::string>& settings : used.points()) {
    std::vector<std::string> all = overrides;
    all.insert(all.end(), settings.begin(), settings.end());
    try {
      check_settings(settings);
      plan.points.push_back({std::move(settings), load_experiment(file, all)});
      check_point(plan.points.back(), plan.points.front());
    } catch (const UsageError& error) {
      const std::string label = sweep_label(std::vector<std::string>(
          all.begin() + static_cast<std::ptrdiff_t>(overrides.size()), all.end()));
      throw UsageError(label.empty() ? std::string(error.what())
                                     : "sweep point " + label + ": " + error.what());
    }
  }
  return plan;
}

std::vector<std::uint8_t> to_bytes(const CampaignPlan& plan) {
  nlohmann::json json = {{"scenario", plan.scenario},     {"first_run", plan.first_run},
                         {"num_runs", plan.num_runs},     {"shard", plan.shard},
                         {"num_shards", plan.num_shards}, {"identity", plan.identity()},
                         {"kernel", plan.kernel_text()}};
  json["points"] = nlohmann::json::array();
  for (const CampaignPoint& point : plan.points)
    json["points"].push_back({{"settings", point.settings}, {"text", point.experiment.resolved}});
  return nlohmann::json::to_msgpack(json);
}

CampaignPlan campaign_plan_from(const std::vector<std::uint8_t>& bytes) {
  const nlohmann::json json = nlohmann::json::from_msgpack(bytes);
  CampaignPlan plan;
  json.at("scenario").get_to(plan.scenario);
  json.at("first_run").get_to(plan.first_run);
  json.at("num_runs").get_to(plan.num_runs);
  json.at("shard").get_to(plan.shard);
  json.at("num_shards").get_to(plan.num_shards);
  for (const auto& point : json.at("points")) {
    plan.points.push_back({point.at("settings").get<std::vector<std::string>>(),
                           experiment_from_text(point.at("text"), "the first process's scenario")});
  }
  if (plan.identity() != json.at("identity").get<std::string>()) {
    throw JobError("this process would compute otherwise than the first one: kernel " +
                   plan.kernel_text() + " of version " + version_text() + ", commit " +
                   commit_text() + ", where that one has " + json.at("kernel").get<std::string>() +
                   "; use one build, and the same estimators.NAME.kernel, on all machines");
  }
  return plan;
}

}  // namespace holdfast
