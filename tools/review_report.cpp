#include "tools/review_report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "common/errors.h"
#include "tools/printable_text.h"

namespace holdfast {
namespace {

using Json = nlohmann::ordered_json;

std::string number(double value, int digits = 4) {
  char text[32];
  std::snprintf(text, sizeof text, "%.*g", digits, value);
  return text;
}

std::string optional_number(const std::optional<double>& value) {
  return value ? number(*value) : "-";
}

// Rows of cells under a header: the first column to the left, the others to the right.
class TextTable {
 public:
  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }

  std::string text() const {
    std::vector<std::size_t> widths;
    for (const auto& row : rows_) {
      widths.resize(std::max(widths.size(), row.size()), 0);
      for (std::size_t c = 0; c < row.size(); ++c)
        widths[c] = std::max(widths[c], text_width(row[c]));
    }
    std::string text;
    for (const auto& row : rows_) {
      std::string line;
      for (std::size_t c = 0; c < row.size(); ++c) {
        const std::string space(widths[c] - text_width(row[c]), ' ');
        line += c == 0 ? row[c] + space : "  " + space + row[c];
      }
      text += line.substr(0, line.find_last_not_of(' ') + 1) + '\n';
    }
    return text;
  }

 private:
  std::vector<std::vector<std::string>> rows_;
};

std::string estimator_table(const RunReview& review) {
  if (review.estimators.empty()) return "no estimates\n";
  TextTable table;
  std::vector<std::string> header = {"RMSE"};
  for (const GroupError& error : review.estimators.front().errors) {
    header.push_back(printable(error.name, 40) +
                     (error.unit.empty() ? "" : " " + printable(error.unit, 20)));
  }
  for (const char* title :
       {"steps", "missing", "not ok", "NEES", "AUC", "p50 us", "p99 us", "max us"}) {
    header.emplace_back(title);
  }
  table.add(header);
  for (const EstimatorReview& estimator : review.estimators) {
    std::vector<std::string> row = {printable(estimator.name, 40)};
    for (const GroupError& error : estimator.errors) row.push_back(optional_number(error.rmse));
    std::int64_t not_ok = 0;
    for (const auto& [name, count] : estimator.outcomes) not_ok += count;
    row.push_back(std::to_string(estimator.num_steps));
    row.push_back(estimator.is_campaign_only ? "campaign"
                                             : std::to_string(estimator.missing_steps));
    row.push_back(std::to_string(not_ok));
    row.push_back(optional_number(estimator.nees_mean));
    row.push_back(optional_number(estimator.packet_auc));
    const TimeSummary& time = estimator.compute_time;
    for (const double value : {time.p50_us, time.p99_us, time.max_us}) {
      row.push_back(time.count == 0 ? "-" : number(value));
    }
    table.add(row);
  }
  std::string text = table.text();
  for (const EstimatorReview& estimator : review.estimators) {
    for (const auto& [name, count] : estimator.outcomes) {
      text +=
          printable(estimator.name, 40) + ": " + std::to_string(count) + " steps " + name + '\n';
    }
  }
  return text;
}

std::string frame_lines(const RunReview& review) {
  const auto count = [](const std::optional<std::int64_t>& value) {
    return value ? std::to_string(*value) : std::string("-");
  };
  TextTable table;
  table.add({"frames", "sent " + count(review.frames_sent),
             "touched " + std::to_string(review.frames_touched),
             "received " + count(review.frames_received)});
  std::string text = table.text();
  const auto labels = [&text](const char* title,
                              const std::map<PacketLabel, std::int64_t>& counts) {
    if (counts.empty()) return;
    text += title;
    for (const auto& [label, number_of] : counts)
      text += "  " + std::string(to_string(label)) + ' ' + std::to_string(number_of);
    text += '\n';
  };
  if (review.frames.has_sent) {
    labels("on bus", review.frames.count);
    labels("packets", review.packet_count);
  }
  text += "losses  " + std::to_string(review.losses_in_all) + '\n';
  text += "refused  datagrams in the log " + std::to_string(review.refused_in_log) +
          "  by the processes " + std::to_string(review.refused_by_processes) + '\n';
  for (const auto& [channel, trouble] : review.troubles) {
    for (const auto& [verdict, number_of] : trouble.refused) {
      text +=
          "  " + printable(channel, 60) + ": " + std::to_string(number_of) + ' ' + verdict + '\n';
    }
  }
  return text;
}

std::string rule_table(const RunReview& review) {
  if (review.rules.empty()) return "";
  TextTable table;
  table.add({"rule", "action", "altered", "dropped", "injected"});
  for (const RuleReview& rule : review.rules) {
    table.add({printable(rule.rule, 40), printable(rule.action, 20), std::to_string(rule.altered),
               std::to_string(rule.dropped), std::to_string(rule.injected)});
  }
  return table.text() + '\n';
}

std::string process_lines(const RunReview& review) {
  std::string text;
  for (const ProcessReview& process : review.processes) {
    text += printable(process.name, 40) + ": " + process.state + " at step " +
            std::to_string(process.step);
    for (const auto& [name, value] : process.counters) {
      if (value != 0) text += "  " + printable(name, 40) + ' ' + std::to_string(value);
    }
    text += '\n';
  }
  return text;
}

Json time_json(const TimeSummary& time) {
  if (time.count == 0) return nullptr;
  return {{"count", time.count},
          {"p50_us", time.p50_us},
          {"p99_us", time.p99_us},
          {"max_us", time.max_us}};
}

Json optional_json(const auto& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json estimator_json(const EstimatorReview& estimator) {
  Json json = {{"name", estimator.name},
               {"channel", estimator.channel},
               {"is_in_scenario", estimator.is_in_scenario},
               {"is_campaign_only", estimator.is_campaign_only}};
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
  json["compute_time"] = time_json(estimator.compute_time);
  json["latency"] = time_json(estimator.latency);
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
               {"received", optional_json(review.frames_received)},
               {"recorded", review.frames_recorded}};
  json["labels"] = review.frames.has_sent ? label_json(review.frames.count) : Json(nullptr);
  json["lost"] = review.frames.lost;
  json["lost_unknown"] = review.frames.lost_unknown;
  json["rules"] = Json::array();
  for (const RuleReview& rule : review.rules) {
    json["rules"].push_back({{"rule", rule.rule},
                             {"action", rule.action},
                             {"altered", rule.altered},
                             {"dropped", rule.dropped},
                             {"injected", rule.injected}});
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
               {"refused_in_log", review.refused_in_log},
               {"refused_by_processes", review.refused_by_processes}};
  json["channels"] = Json::object();
  for (const auto& [channel, trouble] : review.troubles) {
    json["channels"][channel] = {{"refused", Json(trouble.refused)},
                                 {"missing_seq", trouble.missing_seq},
                                 {"backward_seq", trouble.backward_seq},
                                 {"odd_step", trouble.odd_step}};
  }
  return json;
}

}  // namespace

std::string review_table(const RunReview& review) {
  std::string text = printable(review.name, 60) + "  seed " + std::to_string(review.seed) +
                     "  run " + std::to_string(review.run) + "  steps " +
                     std::to_string(review.num_steps) + "  scenario " + review.scenario_hash +
                     '\n' + printable(review.file) + "\n\n";
  text += estimator_table(review) + '\n' + frame_lines(review) + '\n' + rule_table(review) +
          process_lines(review);
  for (const std::string& warning : review.warnings) text += "WARNING " + printable(warning) + '\n';
  return text;
}

std::string review_json(const RunReview& review) {
  Json json = {{"file", review.file},
               {"name", review.name},
               {"seed", review.seed},
               {"run", review.run},
               {"scenario_hash", review.scenario_hash},
               {"steps", review.num_steps},
               {"truth_steps", review.truth_steps},
               {"measurement_steps", review.measurement_steps}};
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
  // Names come from the log, so they need not be UTF-8.
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
}

PathPlot path_plot_of(const RunReview& review) {
  PathPlot plot{review.name, review.x_label, review.y_label, review.true_path, {}, review.sensors};
  for (const EstimatorReview& estimator : review.estimators) {
    if (!estimator.path.empty()) plot.estimates.push_back({estimator.name, estimator.path});
  }
  return plot;
}

void write_text_file(const std::string& file, const std::string& text) {
  std::ofstream stream(file, std::ios::binary);
  stream << text;
  if (!stream.flush()) throw JobError(file + ": cannot be written");
}

std::string write_review_report(const RunReview& review, const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw JobError(folder + ": cannot be made: " + error.message());
  const std::string table = review_table(review);
  write_text_file(folder + "/review.txt", table);
  write_text_file(folder + "/review.json", review_json(review));
  const PathPlot plot = path_plot_of(review);
  if (!plot.truth.empty() || !plot.estimates.empty()) {
    write_text_file(folder + "/path.svg", draw_path_plot(plot));
  }
  return table;
}

std::string write_review_report(const std::string& log_file, const std::string& folder) {
  return write_review_report(review_log(log_file), folder);
}

}  // namespace holdfast
