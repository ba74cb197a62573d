#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "attacker/attack_record.h"
#include "tools/metrics/metrics.h"
#include "tools/packet_labels.h"
#include "tools/path_plot.h"

namespace holdfast {

/// Root mean square error of one state group; none when the estimator does not hold those states.
struct GroupError {
  std::string name, unit;
  std::optional<double> rmse;
};

/// Distribution of a time; percentiles by nearest rank.
struct TimeSummary {
  std::int64_t count = 0;
  double p50_us = 0.0, p99_us = 0.0, max_us = 0.0;
  std::optional<std::int64_t> beyond_period;  // how many were longer than the pace of a step
};

/// How one estimator did in one log.
struct EstimatorReview {
  std::string name, channel;
  std::string trace_key;  // among LogTrace::estimators
  bool is_in_scenario = false;
  bool is_campaign_only = false;    // sees clean measurements, so it publishes nothing live
  bool is_offline = false;          // looks back over the log, and nobody has done so yet
  std::int64_t num_steps = 0;       // with both truth and a finite estimate
  std::int64_t missing_steps = 0;   // steps of the scenario without any estimate
  std::int64_t repeated_steps = 0;  // further estimates for a step that had one; the first counts
  std::int64_t non_finite_steps = 0;
  std::map<std::string, std::int64_t> outcomes;  // other than ok, by name
  std::vector<GroupError> errors;                // one for each state group of the scenario
  std::optional<double> nees_mean;  // e' P^-1 e over the steps with a positive definite P
  std::int64_t nees_steps = 0;
  std::optional<double> packet_auc;  // of 1 - posterior against the labels
  std::int64_t packets_scored = 0;
  TimeSummary compute_time;
  TimeSummary latency;         // from the newest reading on the monitor-side bus to the estimate
  TimeSummary sensor_latency;  // from the same reading on the sensor-side bus
  std::vector<PlotPoint> path;
  EstimatorMetrics metrics;  // of this run alone
  RunScores scores;          // kept when it has estimates of at least half the steps
};

struct ProcessReview {
  std::string name, state, remark;
  bool is_finished = false;
  std::int64_t step = 0;
  std::map<std::string, std::int64_t> counters;  // of its newest status

  std::int64_t counter(const std::string& name) const;
};

struct RuleReview {
  std::string rule, action;
  std::array<std::int64_t, AttackRecord::kNumDispositions> frames = {};  // by disposition
};

/// One counter that says that something was lost.
struct Loss {
  std::string where, counter;
  std::int64_t count = 0;
};

/// What was odd about the events of one channel.
struct ChannelTrouble {
  std::map<std::string, std::int64_t> refused;  // events that the guard refused, by verdict
  std::int64_t missing_seq = 0;                 // lost on the way to the logger
  std::int64_t backward_seq = 0;                // a second producer, or two runs in one log
  std::int64_t odd_step = 0;                    // step that is none of the scenario's
  std::int64_t backward_utime = 0;              // time of validity before that of the one before

  std::int64_t num_refused() const;
};

/// A packet of MEASUREMENT with the truth about its frame.
struct PacketRow {
  std::int64_t step = 0, rx_index = -1;
  int source = 0;
  LabelledFrame frame;
};

/// Everything that a log says about its run.
struct RunReview {
  std::string file, name;
  std::int64_t seed = 0, run = 0, num_steps = 0;
  std::string scenario_hash;
  std::string family;           // hash of the scenario but for its seed
  std::int64_t num_scored = 0;  // steps that the metrics have room for
  MetricsOptions metrics_options;
  std::vector<double> is_attacked;  // [num_scored] 1 or 0; empty when the log does not tell
  std::int64_t truth_steps = 0, measurement_steps = 0;
  std::vector<EstimatorReview> estimators;  // scenario's order, then outsiders by channel
  std::vector<ProcessReview> processes;
  std::optional<std::int64_t> frames_sent;      // by the plant
  std::optional<std::int64_t> frames_received;  // by the driver: its own count, else CAN_RX
  std::int64_t frames_recorded = 0;             // CAN_RX
  std::int64_t frames_touched = 0;              // ATTACK_FRAME
  std::int64_t num_commands = 0;                // to the plant: CAN_COMMAND
  std::vector<RuleReview> rules;
  FrameLabels frames;
  std::vector<PacketRow> packets;
  std::map<PacketLabel, std::int64_t> packet_count;
  std::vector<Loss> losses;  // those above 0
  std::int64_t losses_in_all = 0;
  std::int64_t refused_in_log = 0, refused_by_processes = 0;
  std::map<std::string, ChannelTrouble> troubles;  // channels with any
  std::map<std::string, std::int64_t> foreign;     // events of channels that are none of ours
  std::int64_t num_events = 0, damaged_bytes = 0;
  std::int64_t backward_log_times = 0;  // events that the logger stamped before the one before
  std::int64_t backward_log_us = 0;     // the farthest back
  bool tail_is_torn = false;
  std::vector<std::string> warnings;

  std::vector<PlotPoint> true_path, sensors;  // first two states of the group "position"
  std::string x_label, y_label;
};

struct LogTrace;
struct ScenarioFacts;

/// Reads a log of one run, however damaged, and reviews it; errors are those of docs/metrics.md.
/// Throws UsageError when the file cannot be read, holds no RUN_META, or its scenario is no YAML.
RunReview review_log(const std::string& file);

/// A review with what it was made from, for figures.
struct ReviewedLog {
  ReviewedLog();
  ~ReviewedLog();
  ReviewedLog(ReviewedLog&&) noexcept;

  RunReview review;
  std::unique_ptr<ScenarioFacts> facts;
  std::unique_ptr<LogTrace> trace;
};
ReviewedLog read_reviewed_log(const std::string& file);

/// Packets with their labels: step, rx_index, source, label, tx_index, rule. Throws JobError.
void write_labels_csv(const RunReview& review, const std::string& file);

}  // namespace holdfast
