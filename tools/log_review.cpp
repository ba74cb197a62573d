#include "tools/log_review.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <holdfast/estimate_t.hpp>
#include <set>

#include "common/errors.h"
#include "common/log_file.h"
#include "common/run_meta.h"
#include "common/status.h"
#include "tools/experiment.h"
#include "tools/log_meta.h"
#include "tools/log_trace.h"
#include "tools/printable_text.h"
#include "tools/review_metrics.h"
#include "tools/scenario_facts.h"

namespace holdfast {
namespace {

// Of an outcome that anybody may have logged.
std::string name_of_outcome(std::int32_t outcome) {
  const bool is_ours =
      outcome >= 0 && outcome <= static_cast<std::int32_t>(StepOutcome::kDegenerateWeights);
  return is_ours ? outcome_name(static_cast<StepOutcome>(outcome))
                 : "outcome_" + std::to_string(outcome);
}

const char* state_name(std::int32_t state) {
  switch (state) {
    case status_t::STARTING:
      return "starting";
    case status_t::READY:
      return "ready";
    case status_t::RUNNING:
      return "running";
    case status_t::FINISHED:
      return "finished";
    case status_t::FAILED:
      return "failed";
    default:
      return "unknown";
  }
}

TimeSummary summarise(const std::vector<StepTime>& times, double period_s = 0.0) {
  if (times.empty()) return {};
  std::vector<double> times_us;
  for (const StepTime& time : times) times_us.push_back(time.time_us);
  std::sort(times_us.begin(), times_us.end());
  const auto rank = [&times_us](double share) {
    return times_us[static_cast<std::size_t>(
                        std::ceil(share * static_cast<double>(times_us.size()))) -
                    1];
  };
  TimeSummary summary = {static_cast<std::int64_t>(times_us.size()), rank(0.5), rank(0.99),
                         times_us.back(), std::nullopt};
  if (period_s > 0.0) {
    summary.beyond_period = times_us.end() - std::ranges::upper_bound(times_us, 1e6 * period_s);
  }
  return summary;
}

// Counts steps by what can be said of them.
void review_steps(const LogTrace& trace, const EstimatorTrace& estimator, EstimatorReview& review) {
  for (const auto& [step, sample] : estimator.samples) {
    const bool is_finite =
        std::ranges::all_of(sample.mean, [](double v) { return std::isfinite(v); });
    if (sample.outcome != estimate_t::OUTCOME_OK)
      ++review.outcomes[name_of_outcome(sample.outcome)];
    if (!is_finite) ++review.non_finite_steps;
    if (is_finite && trace.truth.contains(step)) ++review.num_steps;
  }
}

std::int64_t count_scored_packets(const FrameLabels& labels, const EstimatorTrace& estimator) {
  return std::ranges::count_if(estimator.packet_posteriors, [&labels](const auto& posterior) {
    return labels.find(posterior.first).label != PacketLabel::kUnknown;
  });
}

class Reviewer {
 public:
  Reviewer(const ScenarioFacts& facts, const LogTrace& trace, RunReview& review)
      : facts_(facts), trace_(trace), review_(review) {}

  void run() {
    review_.num_steps = trace_.num_steps;
    review_.num_scored = trace_.num_scored;
    review_.family = facts_.family;
    review_.metrics_options.seed = review_.seed;
    review_.metrics_options.detection_threshold = facts_.detection_threshold;
    review_.metrics_options.mode_hold_steps = facts_.mode_hold_steps;
    review_.metrics_options.groups = facts_.groups;
    review_.is_attacked = attacked_steps(trace_);
    review_.backward_log_times = trace_.backward_log_times;
    review_.backward_log_us = trace_.backward_log_us;
    review_.foreign = trace_.foreign;
    review_.truth_steps = static_cast<std::int64_t>(trace_.truth.size());
    review_.measurement_steps = static_cast<std::int64_t>(trace_.measurement_steps.size());
    review_processes();
    review_frames();
    review_estimators();
    review_path();
    review_losses();
    add_warnings();
  }

 private:
  void warn(const std::string& text) { review_.warnings.push_back(text); }

  void review_processes() {
    for (const auto& [channel, status] : trace_.statuses) {
      ProcessReview process;
      const bool fits = channel_name("STATUS_", status.name) == channel;
      process.name = fits ? status.name : channel;
      process.state = state_name(status.state);
      process.is_finished = status.state == status_t::FINISHED;
      process.step = status.step;
      process.remark = status.remark;
      for (std::size_t i = 0; i < status.counter_name.size(); ++i) {
        process.counters[status.counter_name[i]] = status.counter_value[i];
      }
      review_.processes.push_back(std::move(process));
    }
  }

  // The process that keeps this counter; processes are told by what they count, not by their names.
  const ProcessReview* process_with(const std::string& counter) const {
    for (const ProcessReview& process : review_.processes) {
      if (process.counters.contains(counter)) return &process;
    }
    return nullptr;
  }

  void review_frames() {
    const ProcessReview* plant = process_with("frames_sent");
    const ProcessReview* driver = process_with("frames");
    const ProcessReview* attacker = process_with("injected");
    review_.frames_recorded = trace_.labeler.num_received();
    if (plant != nullptr) review_.frames_sent = plant->counter("frames_sent");
    if (driver != nullptr) {
      review_.frames_received = driver->counter("frames");
    } else if (review_.frames_recorded > 0) {
      review_.frames_received = review_.frames_recorded;
    }
    review_.frames_touched = trace_.frames_touched;
    review_.num_commands = trace_.num_commands;
    for (const auto& [name, rule] : trace_.rules) review_.rules.push_back(rule);
    const auto ended = [this](const ProcessReview* process) {
      return !review_.tail_is_torn && (process == nullptr || process->is_finished);
    };
    review_.frames = trace_.labeler.labels(ended(driver), ended(attacker));
    review_.packets = trace_.packets;
    for (PacketRow& packet : review_.packets) {
      packet.frame = review_.frames.find(packet.rx_index);
      ++review_.packet_count[packet.frame.label];
    }
  }

  void review_estimators() {
    std::set<std::string> insiders;
    for (const ListedEstimator& listed : facts_.estimators) {
      const std::string suffix = channel_name("", listed.name);
      const auto found = trace_.estimators.find(suffix);
      EstimatorReview review;
      review.name = listed.name;
      review.is_in_scenario = true;
      const bool is_missing = found == trace_.estimators.end();
      review.is_campaign_only = listed.is_campaign_only && is_missing;
      review.is_offline = listed.is_offline && is_missing;
      review_estimator(is_missing ? EstimatorTrace{} : found->second, suffix, review);
      insiders.insert(suffix);
    }
    for (const auto& [suffix, estimator] : pick_outsiders(insiders)) {
      EstimatorReview review;
      review.name = suffix;
      review_estimator(*estimator, suffix, review);
    }
  }

  // Whoever can write to the network can invent estimators; those with most estimates count.
  std::map<std::string, const EstimatorTrace*> pick_outsiders(
      const std::set<std::string>& insiders) {
    constexpr std::size_t kOutsidersMax = 64;
    std::vector<std::pair<std::string, const EstimatorTrace*>> all;
    for (const auto& [suffix, estimator] : trace_.estimators) {
      if (!estimator.samples.empty() && !insiders.contains(suffix))
        all.emplace_back(suffix, &estimator);
    }
    std::ranges::stable_sort(all, std::ranges::greater(),
                             [](const auto& entry) { return entry.second->samples.size(); });
    if (all.size() > kOutsidersMax) {
      warn("left out: " + std::to_string(all.size() - kOutsidersMax) +
           " channels of estimates that the scenario does not name, those with fewest estimates");
      all.resize(kOutsidersMax);
    }
    return {all.begin(), all.end()};
  }

  void review_estimator(const EstimatorTrace& estimator, const std::string& suffix,
                        EstimatorReview review) {
    review.trace_key = suffix;
    review.channel = estimate_channel(suffix);
    review.repeated_steps = estimator.repeated;
    review.missing_steps =
        review.is_campaign_only || review.is_offline
            ? 0
            : std::max<std::int64_t>(
                  0, trace_.num_steps - static_cast<std::int64_t>(estimator.samples.size()));
    review_steps(trace_, estimator, review);
    review.packets_scored = count_scored_packets(review_.frames, estimator);
    review_scores(review_, score_estimator(facts_, trace_, review_.frames, review.name, estimator),
                  review);
    // Somebody may have logged thousands of estimators with an estimate each.
    if (2 * static_cast<std::int64_t>(estimator.samples.size()) < review_.num_scored) {
      review.scores = {};
      review.metrics.curves.clear();
    }
    review.compute_time = summarise(estimator.compute_time);
    const double period_s = facts_.experiment == nullptr ? 0.0 : facts_.experiment->period_s;
    review.latency = summarise(estimator.latency, period_s);
    review.sensor_latency = summarise(sensor_latency(estimator.latency), period_s);
    if (const StateGroup* position = position_group()) {
      for (const auto& [step, sample] : estimator.samples)
        add_point(sample.mean, *position, review.path);
    }
    review_.estimators.push_back(std::move(review));
  }

  // What the way through the attacker adds, where the log says when its frames were read.
  std::vector<StepTime> sensor_latency(const std::vector<StepTime>& latency) const {
    std::vector<StepTime> times;
    for (const StepTime& time : latency) {
      const auto newest = trace_.newest_packets.find(time.step);
      if (newest == trace_.newest_packets.end()) continue;
      const std::int64_t tx_index = review_.frames.find(newest->second.rx_index).tx_index;
      const auto sensor = trace_.sensor_utimes.find(tx_index);
      if (sensor == trace_.sensor_utimes.end()) continue;
      const auto way_us =
          static_cast<double>(newest->second.receive_utime) - static_cast<double>(sensor->second);
      times.push_back({time.step, time.time_us + way_us});
    }
    return times;
  }

  const StateGroup* position_group() const {
    for (const StateGroup& group : facts_.groups) {
      if (group.name == "position" && group.states.size() >= 2) return &group;
    }
    return nullptr;
  }

  static void add_point(const std::vector<double>& state, const StateGroup& position,
                        std::vector<PlotPoint>& path) {
    const auto x = static_cast<std::size_t>(position.states[0]);
    const auto y = static_cast<std::size_t>(position.states[1]);
    if (std::max(x, y) < state.size()) path.push_back({state[x], state[y]});
  }

  void review_path() {
    const StateGroup* position = position_group();
    if (position == nullptr) return;
    for (const auto& [step, truth] : trace_.truth)
      add_point(truth.state, *position, review_.true_path);
    review_.sensors = facts_.sensors;
    review_.x_label = state_label(facts_, position->states[0]);
    review_.y_label = state_label(facts_, position->states[1]);
  }

  void add_loss(const std::string& where, const std::string& counter, std::int64_t count) {
    if (count <= 0) return;
    review_.losses.push_back({where, counter, count});
    review_.losses_in_all += std::min(count, kCountMax);
  }

  void review_losses() {
    for (const ProcessReview& process : review_.processes) {
      for (const auto& [counter, value] : process.counters) {
        if (is_loss_counter(counter)) add_loss(process.name, counter, value);
      }
      review_.refused_by_processes +=
          std::clamp<std::int64_t>(process.counter("lcm_refused"), 0, kCountMax);
    }
    add_loss("monitor bus", "sent by the attacker, not read by the driver", review_.frames.lost);
    const ProcessReview *attacker = process_with("commands_sent"),
                        *plant = process_with("commands");
    if (attacker != nullptr && plant != nullptr) {
      add_loss("sensor bus", "commands sent by the attacker, not read by the plant",
               attacker->counter("commands_sent") - plant->counter("commands"));
    }
    for (const auto& [channel, trouble] : trace_.troubles) {
      review_.refused_in_log += trouble.num_refused();
      add_loss("log", "missing on " + channel, trouble.missing_seq);
      if (trouble.num_refused() + trouble.missing_seq + trouble.backward_seq + trouble.odd_step +
              trouble.backward_utime >
          0) {
        review_.troubles[channel] = trouble;
      }
    }
  }

  void add_warnings() {
    for (const Loss& loss : review_.losses) {
      warn("lost: " + std::to_string(loss.count) + " (" + loss.where + ", " + loss.counter + ")");
    }
    for (const ProcessReview& process : review_.processes) {
      if (process.is_finished) continue;
      warn(process.name + " did not finish: its last word, at step " +
           std::to_string(process.step) + ", was '" + process.state + "'" +
           (process.remark.empty() ? "" : ": " + process.remark));
    }
    warn_of_commands();
    for (const EstimatorReview& estimator : review_.estimators) warn_of(estimator);
    if (review_.truth_steps < review_.num_steps) {
      warn("the truth is known in " + std::to_string(review_.truth_steps) + " of " +
           std::to_string(review_.num_steps) + " steps");
    }
    if (review_.damaged_bytes > 0)
      warn(std::to_string(review_.damaged_bytes) +
           " bytes of the log are damaged and were skipped");
    if (trace_.left_out > 0) {
      warn("left out: " + std::to_string(trace_.left_out) +
           " events of channels beyond the first thousand that the scenario does not name");
    }
    if (review_.backward_log_us > kBackwardAllowance_us) {
      warn(
          "the log's time goes back " + std::to_string(review_.backward_log_times) +
          " times, by more than a logger's queue explains; the review goes by steps, so nothing is "
          "lost by that");
    }
    if (review_.num_scored < review_.num_steps) {
      warn("steps after " + std::to_string(review_.num_scored) +
           " have no place in the metrics: the log's steps do not follow each other");
    }
    if (review_.tail_is_torn) warn("the log ends in the middle of an event");
    if (trace_.scenario_hashes.size() > 1)
      warn("the log holds more than one scenario; the first one counts");
    for (const auto& [channel, trouble] : review_.troubles) {
      if (trouble.backward_seq > 0) {
        warn(channel + ": seq went back " + std::to_string(trouble.backward_seq) +
             " times, so the channel has a second producer or the log a second run");
      }
      if (trouble.backward_utime > 0) {
        warn(channel + ": utime went back " + std::to_string(trouble.backward_utime) + " times");
      }
      if (trouble.odd_step > 0) {
        warn(channel + ": " + std::to_string(trouble.odd_step) +
             " messages of steps that the scenario has not");
      }
    }
  }

  void warn_of_commands() {
    for (const ProcessReview& process : review_.processes) {
      if (const std::int64_t late = process.counter("late_commands"); late > 0) {
        warn(process.name + ": " + std::to_string(late) +
             " commands came after the step at which they were to act and acted in the next one; "
             "give them more lead_steps");
      }
      if (const std::int64_t refused = process.counter("refused_commands"); refused > 0) {
        warn(process.name + ": refused " + std::to_string(refused) +
             " commands: malformed, of no mode of the plant, or too many waiting");
      }
    }
  }

  void warn_of(const EstimatorReview& estimator) {
    const auto add = [&](std::int64_t count, const char* text) {
      if (count > 0) warn(estimator.name + ": " + std::to_string(count) + text);
    };
    add(estimator.missing_steps, " steps without an estimate");
    add(estimator.repeated_steps, " further estimates for a step that had one; the first counts");
    add(estimator.non_finite_steps, " estimates that are not finite, left out of the errors");
  }

  // A message is stamped when its first part arrives and logged when it is complete, so stamps of
  // a sound log can be a little out of order.
  static constexpr std::int64_t kBackwardAllowance_us = 100'000;
  // Keeps a sum of counters that anybody may have written from overflowing.
  static constexpr std::int64_t kCountMax = std::int64_t{1} << 40;

  const ScenarioFacts& facts_;
  const LogTrace& trace_;
  RunReview& review_;
};

}  // namespace

std::int64_t ProcessReview::counter(const std::string& counter_name) const {
  const auto found = counters.find(counter_name);
  return found == counters.end() ? 0 : found->second;
}

std::int64_t ChannelTrouble::num_refused() const {
  std::int64_t sum = 0;
  for (const auto& [verdict, count] : refused) sum += count;
  return sum;
}

ReviewedLog::ReviewedLog() = default;
ReviewedLog::~ReviewedLog() = default;
ReviewedLog::ReviewedLog(ReviewedLog&&) noexcept = default;

ReviewedLog read_reviewed_log(const std::string& file) {
  const LoggedMeta logged = read_logged_meta(file);
  const RunMeta& meta = logged.meta;
  ReviewedLog log;
  RunReview& review = log.review;
  review.file = file;
  review.name = meta.name;
  review.seed = meta.seed;
  review.run = meta.run;
  review.scenario_hash = scenario_hash(meta.scenario);
  log.facts = std::make_unique<ScenarioFacts>(facts_of(logged, file));
  if (logged.is_damaged) {
    review.warnings.emplace_back(
        "the scenario in RUN_META is damaged: names, units, groups and the number of steps may be "
        "wrong or missing");
  }
  LogReader reader(file);
  log.trace = std::make_unique<LogTrace>(collect_trace(reader, *log.facts, review.num_events));
  review.damaged_bytes = reader.damaged_bytes();
  review.tail_is_torn = reader.tail_is_torn();
  Reviewer(*log.facts, *log.trace, review).run();
  return log;
}

RunReview review_log(const std::string& file) {
  return std::move(read_reviewed_log(file).review);
}

void write_labels_csv(const RunReview& review, const std::string& file) {
  std::ofstream stream(file);
  stream << "step,rx_index,source,label,tx_index,rule\n";
  for (const PacketRow& packet : review.packets) {
    std::string rule;
    for (const char c : printable(packet.frame.rule))
      rule += c == '"' ? std::string("\"\"") : std::string(1, c);
    stream << packet.step << ',' << packet.rx_index << ',' << packet.source << ','
           << to_string(packet.frame.label) << ',' << packet.frame.tx_index << ",\"" << rule
           << "\"\n";
  }
  if (!stream.flush()) throw JobError(file + ": cannot be written");
}

}  // namespace holdfast
