#include "tools/review_report.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "common/errors.h"
#include "tools/printable_text.h"
#include "tools/report/report_page.h"
#include "tools/review_figures.h"
#include "tools/review_json.h"
#include "tools/review_tables.h"
#include "tools/text_table.h"

namespace holdfast {
namespace {

std::string estimator_lines(const RunReview& review) {
  if (review.estimators.empty()) return "no estimates\n";
  std::string text = text_of(error_table(review));
  for (const EstimatorReview& estimator : review.estimators) {
    for (const auto& [name, count] : estimator.outcomes) {
      text +=
          printable(estimator.name, 40) + ": " + std::to_string(count) + " steps " + name + '\n';
    }
  }
  const std::string metrics = text_of(metric_table(review));
  return metrics.empty() ? text : text + '\n' + metrics;
}

// Events that nobody of ours wrote: how many, and on which channels.
std::string foreign_line(const RunReview& review) {
  if (review.foreign.empty()) return "";
  constexpr std::size_t kNamesMax = 5;
  std::int64_t sum = 0;
  std::size_t num_named = 0;
  std::string names;
  for (const auto& [channel, count] : review.foreign) {
    sum += count;
    if (num_named++ < kNamesMax) names += (names.empty() ? " " : ", ") + printable(channel, 40);
  }
  if (num_named > kNamesMax) names += ", ...";
  return "foreign  " + std::to_string(sum) + " events on " + std::to_string(num_named) +
         " channels that are none of ours:" + names + '\n';
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
  if (review.backward_log_times > 0) {
    text += "log      time goes back " + std::to_string(review.backward_log_times) +
            " times, by at most " +
            number_text(1e-6 * static_cast<double>(review.backward_log_us)) + " s\n";
  }
  text += foreign_line(review);
  for (const auto& [channel, trouble] : review.troubles) {
    for (const auto& [verdict, number_of] : trouble.refused) {
      text +=
          "  " + printable(channel, 60) + ": " + std::to_string(number_of) + ' ' + verdict + '\n';
    }
  }
  return text;
}

// A log of a campaign has no latencies: nothing stood on a bus.
std::string latency_lines(const RunReview& review) {
  const auto has_latency = [](const EstimatorReview& e) { return e.latency.count > 0; };
  if (std::ranges::none_of(review.estimators, has_latency)) return "";
  const ReportTable table = time_table(review);
  return text_of(table) + table.note + (table.note.empty() ? "\n" : "\n\n");
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

}  // namespace

std::string review_table(const RunReview& review) {
  std::string text = printable(review.name, 60) + "  seed " + std::to_string(review.seed) +
                     "  run " + std::to_string(review.run) + "  steps " +
                     std::to_string(review.num_steps) + "  scenario " + review.scenario_hash +
                     '\n' + printable(review.file) + "\n\n";
  const std::string rules = text_of(rule_table(review));
  text += estimator_lines(review) + '\n' + frame_lines(review) + '\n' +
          (rules.empty() ? "" : rules + '\n') + latency_lines(review) + process_lines(review);
  for (const std::string& warning : review.warnings) text += "WARNING " + printable(warning) + '\n';
  return text;
}

std::string combined_table(const CombinedReview& combined) {
  std::string text =
      printable(combined.name, 60) + "  " + std::to_string(combined.files.size()) + " runs\n\n";
  for (const ReportTable& table : combined_tables(combined)) text += text_of(table) + '\n';
  for (const std::string& note : combined.notes) text += "WARNING " + printable(note) + '\n';
  return text;
}

PathPlot path_plot_of(const RunReview& review) {
  PathPlot plot{review.name, review.x_label, review.y_label, review.true_path, {}, review.sensors};
  for (const EstimatorReview& estimator : review.estimators) {
    if (!estimator.path.empty()) plot.estimates.push_back({estimator.name, estimator.path});
  }
  return plot;
}

void make_folder(const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw JobError(folder + ": cannot be made: " + error.message());
}

void write_text_file(const std::string& file, const std::string& text) {
  std::ofstream stream(file, std::ios::binary);
  stream << text;
  if (!stream.flush()) throw JobError(file + ": cannot be written");
}

std::string write_review_report(const ReviewedLog& log, const std::string& folder) {
  const RunReview& review = log.review;
  make_folder(folder);
  std::string table = review_table(review);
  try {
    write_text_file(folder + "/report.html", report_page(log_report(log)));
  } catch (const JobError& error) {
    table += "no report.html: " + std::string(error.what()) + '\n';
  }
  write_text_file(folder + "/review.txt", table);
  write_text_file(folder + "/review.json", review_json(review));
  const PathPlot plot = path_plot_of(review);
  if (!plot.truth.empty() || !plot.estimates.empty()) {
    write_text_file(folder + "/path.svg", draw_path_plot(plot));
  }
  return table;
}

std::string write_review_report(const std::string& log_file, const std::string& folder) {
  return write_review_report(read_reviewed_log(log_file), folder);
}

}  // namespace holdfast
