#include "tools/review_tables.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include "tools/printable_text.h"
#include "tools/text_table.h"

namespace holdfast {
namespace {

constexpr std::size_t kNameBytes = 40;

std::string name_text(const std::string& name) {
  return printable(name, kNameBytes);
}

std::string optional_text(const std::optional<double>& value) {
  return value ? number_text(*value) : "-";
}

std::string count_text(const std::optional<std::int64_t>& value) {
  return value ? std::to_string(*value) : "-";
}

ReportTable frame_table(const RunReview& review) {
  ReportTable table{"Frames", {"frames", "count"}, {}, ""};
  table.rows = {{"sent by the plant", count_text(review.frames_sent)},
                {"touched by a rule", std::to_string(review.frames_touched)},
                {"received by the driver", count_text(review.frames_received)}};
  if (review.num_commands > 0)
    table.rows.push_back({"commands that the plant read", std::to_string(review.num_commands)});
  if (!review.frames.has_sent) return table;
  for (const auto& [label, count] : review.frames.count)
    table.rows.push_back({std::string(to_string(label)) + ", on the bus", std::to_string(count)});
  for (const auto& [label, count] : review.packet_count)
    table.rows.push_back(
        {std::string(to_string(label)) + ", among the packets", std::to_string(count)});
  return table;
}

ReportTable loss_table(const RunReview& review) {
  ReportTable table{"Losses", {"where", "counter", "count"}, {}, ""};
  for (const Loss& loss : review.losses)
    table.rows.push_back(
        {name_text(loss.where), printable(loss.counter, 60), std::to_string(loss.count)});
  return table;
}

ReportTable trouble_table(const RunReview& review) {
  ReportTable table{
      "The log", {"channel", "refused", "missing", "seq back", "utime back", "odd steps"}, {}, ""};
  for (const auto& [channel, trouble] : review.troubles) {
    table.rows.push_back({printable(channel, 60), std::to_string(trouble.num_refused()),
                          std::to_string(trouble.missing_seq), std::to_string(trouble.backward_seq),
                          std::to_string(trouble.backward_utime),
                          std::to_string(trouble.odd_step)});
  }
  table.note = std::to_string(review.num_events) + " events, " +
               std::to_string(review.damaged_bytes) + " damaged bytes skipped" +
               (review.tail_is_torn ? ", torn tail" : "");
  return table;
}

ReportTable foreign_table(const RunReview& review) {
  constexpr std::size_t kRowsMax = 50;
  ReportTable table{"Channels that are none of ours", {"channel", "events"}, {}, ""};
  for (const auto& [channel, count] : review.foreign) {
    if (table.rows.size() == kRowsMax) {
      table.note = "The first " + std::to_string(kRowsMax) + " of " +
                   std::to_string(review.foreign.size()) + ".";
      break;
    }
    table.rows.push_back({printable(channel, 60), std::to_string(count)});
  }
  return table;
}

ReportTable process_table(const RunReview& review) {
  ReportTable table{"Processes", {"process", "state", "step", "counters", "remark"}, {}, ""};
  for (const ProcessReview& process : review.processes) {
    std::string counters;
    for (const auto& [name, value] : process.counters) {
      if (value == 0) continue;
      counters += (counters.empty() ? "" : ", ") + name_text(name) + ' ' + std::to_string(value);
    }
    table.rows.push_back({name_text(process.name), process.state, std::to_string(process.step),
                          counters, printable(process.remark, 200)});
  }
  return table;
}

}  // namespace

ReportTable time_table(const RunReview& review) {
  ReportTable table{
      "Times",
      {"estimator", "time of", "steps", "p50 us", "p99 us", "max us", "beyond a period"},
      {},
      ""};
  for (const EstimatorReview& estimator : review.estimators) {
    for (const auto& [what, time] :
         {std::pair("a step", &estimator.compute_time),
          std::pair("monitor bus to estimate", &estimator.latency),
          std::pair("sensor bus to estimate", &estimator.sensor_latency)}) {
      if (time->count == 0) continue;
      table.rows.push_back({name_text(estimator.name), what, std::to_string(time->count),
                            number_text(time->p50_us), number_text(time->p99_us),
                            number_text(time->max_us), count_text(time->beyond_period)});
    }
  }
  for (const ProcessReview& process : review.processes) {
    if (!process.counters.contains("missed_deadlines")) continue;
    const std::int64_t missed = process.counter("missed_deadlines");
    const double share = 100.0 * static_cast<double>(missed) /
                         static_cast<double>(std::max<std::int64_t>(missed + process.step, 1));
    table.note = "Deadlines of the pace that " + name_text(process.name) +
                 " missed: " + std::to_string(missed) + " of " +
                 std::to_string(missed + process.step) + " (" + number_text(share) + " %).";
  }
  return table;
}

ReportTable error_table(const RunReview& review) {
  ReportTable table{"RMSE over time", {"RMSE"}, {}, ""};
  if (review.estimators.empty()) return table;
  for (const GroupError& error : review.estimators.front().errors) {
    std::string title = name_text(error.name);
    if (!error.unit.empty()) title.append(" ").append(printable(error.unit, 20));
    table.header.push_back(std::move(title));
  }
  for (const char* title :
       {"steps", "missing", "not ok", "NEES", "AUC", "p50 us", "p99 us", "max us"}) {
    table.header.emplace_back(title);
  }
  for (const EstimatorReview& estimator : review.estimators) {
    std::vector<std::string> row = {name_text(estimator.name)};
    for (const GroupError& error : estimator.errors) row.push_back(optional_text(error.rmse));
    std::int64_t not_ok = 0;
    for (const auto& [name, count] : estimator.outcomes) not_ok += count;
    row.push_back(std::to_string(estimator.num_steps));
    row.push_back(estimator.is_campaign_only ? "campaign"
                  : estimator.is_offline     ? "offline"
                                             : std::to_string(estimator.missing_steps));
    row.push_back(std::to_string(not_ok));
    row.push_back(optional_text(estimator.nees_mean));
    row.push_back(optional_text(estimator.packet_auc));
    const TimeSummary& time = estimator.compute_time;
    for (const double value : {time.p50_us, time.p99_us, time.max_us})
      row.push_back(time.count == 0 ? "-" : number_text(value));
    table.rows.push_back(std::move(row));
  }
  return table;
}

ReportTable metric_table(const std::vector<const EstimatorMetrics*>& estimators, bool has_rmse) {
  ReportTable table{"Metrics", {"metric", "group", "unit"}, {}, ""};
  std::vector<const Metric*> wanted;
  for (const EstimatorMetrics* estimator : estimators) {
    table.header.push_back(name_text(estimator->estimator));
    for (const Metric& metric : estimator->metrics) {
      if (!has_rmse && metric.name.starts_with("rmse_")) continue;
      const auto is_same = [&](const Metric* other) {
        return other->name == metric.name && other->group == metric.group;
      };
      if (std::ranges::none_of(wanted, is_same)) wanted.push_back(&metric);
    }
  }
  for (const Metric* metric : wanted) {
    std::vector<std::string> row = {metric->name, name_text(metric->group),
                                    printable(metric->unit, 20)};
    for (const EstimatorMetrics* estimator : estimators) {
      const Metric* found = find_metric(*estimator, metric->name, metric->group);
      row.push_back(found == nullptr ? "-"
                                     : number_with_error(found->value, found->standard_error));
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

ReportTable metric_table(const RunReview& review) {
  std::vector<const EstimatorMetrics*> estimators;
  for (const EstimatorReview& estimator : review.estimators) {
    if (!estimator.metrics.metrics.empty()) estimators.push_back(&estimator.metrics);
  }
  return metric_table(estimators, false);
}

ReportTable rule_table(const RunReview& review) {
  ReportTable table{"Rules", {"rule", "action"}, {}, ""};
  for (const RuleReview& rule : review.rules)
    table.rows.push_back({name_text(rule.rule), printable(rule.action, 20)});
  for (std::size_t i = 0; i < AttackRecord::kNumDispositions; ++i) {
    const auto disposition = static_cast<AttackRecord::Disposition>(i);
    const bool is_of_delays = disposition == AttackRecord::Disposition::kHeld ||
                              disposition == AttackRecord::Disposition::kReleased;
    const bool is_there = std::ranges::any_of(
        review.rules, [i](const RuleReview& rule) { return rule.frames[i] != 0; });
    if (is_of_delays && !is_there) continue;
    table.header.emplace_back(to_string(disposition));
    for (std::size_t r = 0; r < review.rules.size(); ++r)
      table.rows[r].push_back(std::to_string(review.rules[r].frames[i]));
  }
  return table;
}

ReportTable difference_table(const CombinedReview& combined) {
  ReportTable table{"Paired differences",
                    {"estimator", "minus", "metric", "group", "unit", "difference"},
                    {},
                    "both estimators saw the same runs"};
  for (const PairedDifference& difference : combined.differences) {
    table.rows.push_back({name_text(difference.estimator), name_text(difference.reference),
                          difference.name, name_text(difference.group),
                          printable(difference.unit, 20),
                          number_with_error(difference.value, difference.standard_error)});
  }
  return table;
}

std::vector<ReportTable> report_tables(const RunReview& review) {
  std::vector<ReportTable> tables = {
      error_table(review), metric_table(review),  frame_table(review),
      rule_table(review),  loss_table(review),    process_table(review),
      time_table(review),  trouble_table(review), foreign_table(review)};
  std::erase_if(tables, [](const ReportTable& table) { return table.rows.empty(); });
  return tables;
}

std::vector<ReportTable> combined_tables(const CombinedReview& combined) {
  std::vector<const EstimatorMetrics*> estimators;
  for (const EstimatorMetrics& estimator : combined.estimators) estimators.push_back(&estimator);
  std::vector<ReportTable> tables = {metric_table(estimators, true), difference_table(combined)};
  tables.front().title = "Metrics over " + std::to_string(combined.files.size()) + " runs";
  std::erase_if(tables, [](const ReportTable& table) { return table.rows.empty(); });
  return tables;
}

std::string text_of(const ReportTable& table) {
  if (table.rows.empty()) return "";
  // Columns of words stand in front of those of numbers; a metric's name is one of them.
  static constexpr std::array<std::string_view, 7> kWords = {
      "estimator", "minus", "metric", "group", "unit", "action", "time of"};
  std::size_t num_left = 1;
  while (num_left < table.header.size() &&
         std::ranges::find(kWords, table.header[num_left]) != kWords.end()) {
    ++num_left;
  }
  TextTable text(num_left);
  text.add(table.header);
  for (const auto& row : table.rows) text.add(row);
  return text.text();
}

}  // namespace holdfast
