#include "tools/review_json.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace holdfast {
namespace {

using Json = nlohmann::ordered_json;

Json number_json(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Json metric_json(const auto& metric) {
  Json json = {{"name", metric.name}};
  if (!metric.group.empty()) json["group"] = metric.group;
  json["value"] = number_json(metric.value);
  json["standard_error"] = number_json(metric.standard_error);
  if (!metric.unit.empty()) json["unit"] = metric.unit;
  return json;
}

Json metrics_json(const EstimatorMetrics& metrics) {
  Json json = Json::array();
  for (const Metric& metric : metrics.metrics) {
    json.push_back(metric_json(metric));
    json.back()["count"] = metric.count;
  }
  return json;
}

Json rocs_json(const EstimatorMetrics& metrics) {
  Json json = Json::object();
  for (const RocCurve& roc : metrics.rocs) {
    json[roc.name] = {{"false_alarm_rate", roc.false_alarm_rate},
                      {"detection_rate", roc.detection_rate},
                      {"area", number_json(roc.area)}};
  }
  return json;
}

Json attacked_json(const RunReview& review) {
  if (review.is_attacked.empty()) return nullptr;
  return std::ranges::count(review.is_attacked, 1.0);
}

Json optional_json(const auto& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json time_json(const TimeSummary& time) {
  if (time.count == 0) return nullptr;
  return {{"count", time.count},
          {"p50_us", time.p50_us},
          {"p99_us", time.p99_us},
          {"max_us", time.max_us},
          {"beyond_period", optional_json(time.beyond_period)}};
}

Json estimator_json(const EstimatorReview& estimator) {
  Json json = {{"name", estimator.name},
               {"channel", estimator.channel},
               {"is_in_scenario", estimator.is_in_scenario},
               {"is_campaign_only", estimator.is_campaign_only},
               {"is_offline", estimator.is_offline}};
  json["rmse"] = Json::object();
  for (const GroupError& error : estimator.errors) {
    json["rmse"][error.name] = {{"value", optional_json(error.rmse)}, {"unit", error.unit}};
  }
  json["steps"] = estimator.num_steps;
  json["missing_steps"] = estimator.missing_steps;
  json["repeated_steps"] = estimator.repeated_steps;
  json["non_finite_steps"] = estimator.non_finite_steps;
  json["outcomes_not_ok"] = Json(estimator.outcomes);
  json["nees_mean"] = optional_json(estimator.nees_mean);
  json["nees_steps"] = estimator.nees_steps;
  json["packet_auc"] = optional_json(estimator.packet_auc);
  json["packets_scored"] = estimator.packets_scored;
  json["metrics"] = metrics_json(estimator.metrics);
  json["rocs"] = rocs_json(estimator.metrics);
  json["compute_time"] = time_json(estimator.compute_time);
  json["latency"] = time_json(estimator.latency);
  json["sensor_latency"] = time_json(estimator.sensor_latency);
  return json;
}

Json label_json(const std::map<PacketLabel, std::int64_t>& counts) {
  Json json = Json::object();
  for (const PacketLabel label : kPacketLabels) {
    const auto found = counts.find(label);
    json[to_string(label)] = found == counts.end() ? 0 : found->second;
  }
  return json;
}

Json frames_json(const RunReview& review) {
  Json json = {{"sent", optional_json(review.frames_sent)},
               {"touched", review.frames_touched},
               {"commands", review.num_commands},
               {"received", optional_json(review.frames_received)},
               {"recorded", review.frames_recorded}};
  json["labels"] = review.frames.has_sent ? label_json(review.frames.count) : Json(nullptr);
  json["lost"] = review.frames.lost;
  json["lost_unknown"] = review.frames.lost_unknown;
  json["rules"] = Json::array();
  for (const RuleReview& rule : review.rules) {
    Json entry = {{"rule", rule.rule}, {"action", rule.action}};
    for (std::size_t i = 0; i < rule.frames.size(); ++i)
      entry[to_string(static_cast<AttackRecord::Disposition>(i))] = rule.frames[i];
    json["rules"].push_back(std::move(entry));
  }
  return json;
}

Json processes_json(const RunReview& review) {
  Json json = Json::array();
  for (const ProcessReview& process : review.processes) {
    json.push_back({{"name", process.name},
                    {"state", process.state},
                    {"step", process.step},
                    {"remark", process.remark},
                    {"counters", Json(process.counters)}});
  }
  return json;
}

Json log_json(const RunReview& review) {
  Json json = {{"events", review.num_events},
               {"damaged_bytes", review.damaged_bytes},
               {"tail_is_torn", review.tail_is_torn},
               {"backward_log_times", review.backward_log_times},
               {"backward_log_us", review.backward_log_us},
               {"refused_in_log", review.refused_in_log},
               {"refused_by_processes", review.refused_by_processes}};
  json["foreign_channels"] = Json(review.foreign);
  json["channels"] = Json::object();
  for (const auto& [channel, trouble] : review.troubles) {
    json["channels"][channel] = {{"refused", Json(trouble.refused)},
                                 {"missing_seq", trouble.missing_seq},
                                 {"backward_seq", trouble.backward_seq},
                                 {"backward_utime", trouble.backward_utime},
                                 {"odd_step", trouble.odd_step}};
  }
  return json;
}

Json run_json(const RunReview& review) {
  Json json = {{"file", review.file},
               {"name", review.name},
               {"seed", review.seed},
               {"run", review.run},
               {"scenario_hash", review.scenario_hash},
               {"steps", review.num_steps},
               {"truth_steps", review.truth_steps},
               {"measurement_steps", review.measurement_steps}};
  json["detection_threshold"] = review.metrics_options.detection_threshold;
  json["attacked_steps"] = attacked_json(review);
  json["estimators"] = Json::array();
  for (const EstimatorReview& estimator : review.estimators) {
    json["estimators"].push_back(estimator_json(estimator));
  }
  json["frames"] = frames_json(review);
  json["packets"] = label_json(review.packet_count);
  json["losses"] = {{"sum", review.losses_in_all}, {"items", Json::array()}};
  for (const Loss& loss : review.losses) {
    json["losses"]["items"].push_back(
        {{"where", loss.where}, {"counter", loss.counter}, {"count", loss.count}});
  }
  json["processes"] = processes_json(review);
  json["log"] = log_json(review);
  json["warnings"] = review.warnings;
  return json;
}

Json combined_json(const CombinedReview& combined) {
  Json json = {{"name", combined.name}, {"family", combined.family}, {"logs", combined.files}};
  json["estimators"] = Json::array();
  for (const EstimatorMetrics& estimator : combined.estimators) {
    json["estimators"].push_back({{"name", estimator.estimator},
                                  {"metrics", metrics_json(estimator)},
                                  {"rocs", rocs_json(estimator)},
                                  {"outcomes_not_ok", Json(estimator.outcomes)}});
  }
  json["differences"] = Json::array();
  for (const PairedDifference& difference : combined.differences) {
    Json entry = {{"estimator", difference.estimator}, {"reference", difference.reference}};
    entry.update(metric_json(difference));
    json["differences"].push_back(std::move(entry));
  }
  json["notes"] = combined.notes;
  return json;
}

// Names come from the log, so they need not be UTF-8.
std::string text_of(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
}

}  // namespace

std::string review_json(const RunReview& review) {
  return text_of(run_json(review));
}

std::string reviews_json(const std::vector<RunReview>& reviews,
                         const std::vector<CombinedReview>& combined) {
  Json json = {{"logs", Json::array()}, {"combined", Json::array()}};
  for (const RunReview& review : reviews) json["logs"].push_back(run_json(review));
  for (const CombinedReview& runs : combined) json["combined"].push_back(combined_json(runs));
  return text_of(json);
}

}  // namespace holdfast
