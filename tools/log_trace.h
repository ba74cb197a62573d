#pragma once

#include <cstdint>
#include <holdfast/status_t.hpp>
#include <map>
#include <set>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "common/log_file.h"
#include "tools/log_review.h"

namespace holdfast {

/// Gaussians of one hypothesis, after and before reduction.
struct MixtureSize {
  std::string hypothesis;
  std::int32_t num_components = 0, num_candidates = 0;
};

/// One estimate; what the method does not give stays empty or -1.
struct Sample {
  std::int32_t outcome = 0;  // of estimate_t
  double attack_probability = -1.0;
  std::int64_t input_step = -1;
  std::vector<double> mean, covariance, mode_probability, input_mean;
  std::vector<double> innovation, innovation_covariance;
  /// Name and sizes of the mixtures of its hypotheses, the first few that have one.
  std::vector<MixtureSize> mixtures;
};

/// Time of one step of an estimator.
struct StepTime {
  std::int64_t step = 0;
  double time_us = 0.0;
};

/// Ends the key of SMOOTHED_<NAME> among the estimators of a trace; EST_<NAME> has the key <NAME>.
inline constexpr const char* kSmoothedSuffix = "_SMOOTHED";
/// The channel of that key.
std::string estimate_channel(const std::string& key);

/// What the events of one estimator leave behind.
struct EstimatorTrace {
  std::map<std::int64_t, Sample> samples;  // by step
  std::int64_t repeated = 0;
  std::vector<std::pair<std::int64_t, double>> packet_posteriors;  // rx_index, P(authentic)
  std::vector<StepTime> compute_time, latency;
};

/// The newest packet of a step, from which the latency of estimates counts.
struct NewestPacket {
  std::int64_t rx_index = -1, receive_utime = 0;
};

struct TrueState {
  int mode = 0;
  std::vector<double> state;
};

/// A frame that a rule touched (ATTACK_FRAME), or one that the driver read (CAN_RX).
struct FrameMark {
  std::int64_t step = 0, rx_index = -1;
  std::int32_t identifier = 0;
  std::int32_t disposition = 0;  // of attack_frame_t
};

/// Sum of a process's loss counters in one of its statuses.
struct LossMark {
  std::int64_t step = 0, count = 0;
};

/// Everything that one pass over a log collects.
struct LogTrace {
  std::int64_t num_steps = 0;  // 0: the scenario does not say
  /// Steps 1..num_scored have room in the metrics. It is num_steps, but in a log whose steps do not
  /// follow each other, as no run's do.
  std::int64_t num_scored = 0;
  std::map<std::int64_t, TrueState> truth;
  std::set<std::int64_t> measurement_steps;
  std::map<std::string, EstimatorTrace> estimators;     // by the channel's suffix
  std::map<std::string, status_t> statuses;             // newest, by channel
  std::map<std::string, std::vector<LossMark>> losses;  // by channel of the status
  std::map<std::pair<std::string, std::string>, RuleReview> rules;
  std::vector<PacketRow> packets;
  std::map<std::int64_t, NewestPacket> newest_packets;           // by step; those with a stamp
  std::unordered_map<std::int64_t, std::int64_t> sensor_utimes;  // by tx_index: CAN_TX
  PacketLabeler labeler;
  std::int64_t frames_touched = 0;
  std::int64_t num_commands = 0;  // that the plant read
  std::vector<FrameMark> touched, received;
  std::map<std::int64_t, std::vector<double>> attack_signals;  // by step, one after the other,
                                                               // with what rules added to sensors
  std::set<std::int64_t> attacked_steps;
  std::map<std::int64_t, std::uint32_t> frame_actions;  // by step, of all frames: attack_frame_t
  bool knows_attacks = false;  // somebody who would tell of attacks wrote to the log
  std::set<std::string> scenario_hashes;
  std::map<std::string, ChannelTrouble> troubles;
  std::map<std::string, std::int64_t> foreign;  // events of channels that are none of ours
  std::int64_t left_out = 0;                    // events of more channels than any run has
  std::int64_t backward_log_times = 0;          // events stamped before the one before
  std::int64_t backward_log_us = 0;             // the farthest back
};

/// Reads all events. Whatever stands in them, it neither throws nor trusts: events that the guard
/// refuses and steps outside 1..num_steps (0: any) are counted by channel and left out, and so are
/// channels that the scenario does not name beyond the first thousand.
LogTrace collect_trace(LogReader& reader, const ScenarioFacts& facts, std::int64_t& num_events);

/// True for a counter of a status that says that something was lost.
bool is_loss_counter(const std::string& name);

}  // namespace holdfast
