#include "tools/log_trace.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <holdfast/attack_frame_t.hpp>
#include <holdfast/attack_signal_t.hpp>
#include <holdfast/can_frames_t.hpp>
#include <holdfast/estimate_t.hpp>
#include <holdfast/measurement_set_t.hpp>
#include <holdfast/run_meta_t.hpp>
#include <holdfast/timing_t.hpp>
#include <holdfast/truth_t.hpp>
#include <limits>
#include <optional>

#include "attacker/attack_messages.h"
#include "common/status.h"
#include "drivers/can/can_messages.h"
#include "tools/bus_inputs.h"
#include "tools/experiment.h"
#include "tools/log_fields.h"
#include "tools/scenario_facts.h"

namespace holdfast {
namespace {

// Tables over steps that somebody made up would take memory that the file does not stand for.
constexpr std::int64_t kStepsPerMessage = 2, kSpareSteps = 1000;

// Whoever can write to the network can invent channels, each of which takes memory.
constexpr std::size_t kOtherChannelsMax = 1000;

// Keeps a sum of counters that anybody may have written from overflowing.
constexpr std::int64_t kCountMax = std::int64_t{1} << 40;

// A larger jump of seq is a forged number, not a loss that a logger could have had.
constexpr std::int64_t kLossJumpMax = 1'000'000;

class LogCollector {
 public:
  LogCollector(LogTrace& trace, const ScenarioFacts& facts)
      : trace_(trace), attack_truth_(facts.attack_truth) {
    if (facts.experiment != nullptr) {
      codec_.emplace(facts.experiment->layout);
      bus_inputs_.emplace(facts.experiment->plant, *codec_,
                          facts.experiment->assembler.check_counter);
    }
    for (const char* process : {"plant", "driver", "attacker"})
      known_channels_.insert(channel_name("STATUS_", process));
    for (const ListedEstimator& listed : facts.estimators) {
      for (const char* prefix : {"EST_", "TIMING_", "STATUS_", "SMOOTHED_"})
        known_channels_.insert(channel_name(prefix, listed.name));
    }
  }

  void on_event(const LogEvent& event) {
    note_log_time(event.utime);
    const std::string& channel = event.channel;
    if (channel == "PLANT_TRUTH") {
      take<truth_t>(event, [this](const truth_t& m, ChannelTrouble& t) { on_truth(m, t); });
    } else if (channel == "MEASUREMENT") {
      take<measurement_set_t>(event,
                              [this](const auto& m, ChannelTrouble& t) { on_measurement(m, t); });
    } else if (channel == "CAN_RX" || channel == "CAN_TX") {
      take<can_frames_t>(event, [&](const can_frames_t& m, ChannelTrouble&) {
        on_frames(m, channel == "CAN_RX");
      });
    } else if (channel == "CAN_COMMAND") {
      take<can_frames_t>(event, [this](const can_frames_t& m, ChannelTrouble&) {
        trace_.num_commands += m.num_frames;
      });
    } else if (channel == "ATTACK_FRAME") {
      take<attack_frame_t>(event,
                           [this](const attack_frame_t& m, ChannelTrouble& t) { on_attack(m, t); });
    } else if (channel == "ATTACK_SIGNAL") {
      take<attack_signal_t>(
          event, [this](const attack_signal_t& m, ChannelTrouble& t) { on_signal(m, t); });
    } else if (channel == "RUN_META") {
      run_meta_t meta;
      if (decode_guarded(event.data, meta)) trace_.scenario_hashes.insert(meta.scenario_hash);
    } else {
      on_named_channel(event);
    }
  }

  /// Once all events have been seen.
  void finish() {
    for (const auto& [step, added] : added_inputs_) {
      const auto signal = trace_.attack_signals.find(step);
      if (signal == trace_.attack_signals.end() || signal->second.size() != added.size()) continue;
      std::ranges::transform(signal->second, added, signal->second.begin(), std::plus<>());
    }
  }

 private:
  template <class Message, class Handler>
  void take(const LogEvent& event, Handler handler) {
    const GuardVerdict verdict = check_wire(*layouts::of<Message>, Message::getHash(), event.data);
    Message message;
    ChannelTrouble& trouble = trace_.troubles[event.channel];
    if (verdict != GuardVerdict::kOk || !decode_guarded(event.data, message)) {
      ++trouble.refused[to_string(verdict)];
      return;
    }
    const std::string producer = producer_of(event.channel, message);
    note_seq(producer, message.seq, trouble);
    if (goes_by_time(event.channel, message)) {
      const auto [last, is_first] = last_utime_.try_emplace(producer, message.utime);
      if (!is_first && message.utime < last->second) ++trouble.backward_utime;
      last->second = message.utime;
    }
    handler(message, trouble);
  }

  // Plant and attacker both say what they apply, each with its own numbers.
  template <class Message>
  static std::string producer_of(const std::string& channel, const Message&) {
    return channel;
  }
  static std::string producer_of(const std::string& channel, const attack_signal_t& message) {
    return message.name.starts_with(kRuleSignalPrefix) ? channel + " of rules" : channel;
  }

  // Commands speak of a time to come, in any order.
  template <class Message>
  static bool goes_by_time(const std::string& channel, const Message&) {
    return channel != "CAN_COMMAND";
  }
  static bool goes_by_time(const std::string&, const attack_frame_t& message) {
    return message.direction == attack_frame_t::TO_MONITOR;
  }

  void note_seq(const std::string& producer, std::int64_t logged_seq, ChannelTrouble& trouble) {
    // Differences of two stay in range, whatever was logged.
    const std::int64_t seq =
        std::clamp<std::int64_t>(logged_seq, 0, std::numeric_limits<std::int64_t>::max() / 2);
    const auto [last, is_first] = last_seq_.try_emplace(producer, seq);
    if (is_first) return;
    // An outsider that does not count leaves seq at 0.
    if (seq == 0 && last->second == 0) return;
    if (seq <= last->second || seq - last->second > kLossJumpMax) {
      ++trouble.backward_seq;
    } else {
      trouble.missing_seq += seq - last->second - 1;
    }
    last->second = seq;
  }

  bool is_step(std::int64_t step, ChannelTrouble& trouble) const {
    if (step == 0) return false;  // a prior, which has no measurement
    const bool fits = step > 0 && (trace_.num_steps == 0 || step <= trace_.num_steps);
    if (!fits) ++trouble.odd_step;
    return fits;
  }

  void note_log_time(std::int64_t utime) {
    if (has_log_time_ && utime < last_log_utime_) {
      ++trace_.backward_log_times;
      // Unsigned, since a damaged stamp may be as far away as numbers go.
      const auto back =
          static_cast<std::uint64_t>(last_log_utime_) - static_cast<std::uint64_t>(utime);
      constexpr std::uint64_t kMax = std::numeric_limits<std::int64_t>::max();
      trace_.backward_log_us =
          std::max(trace_.backward_log_us, static_cast<std::int64_t>(std::min(back, kMax)));
    }
    has_log_time_ = true;
    last_log_utime_ = utime;
  }

  // Channels of the scenario have their place, whatever was logged before them.
  bool has_place(const std::string& channel) {
    if (known_channels_.contains(channel) || other_channels_.contains(channel)) return true;
    if (other_channels_.size() == kOtherChannelsMax) return false;
    other_channels_.insert(channel);
    return true;
  }

  void on_named_channel(const LogEvent& event) {
    const std::string& channel = event.channel;
    if (!has_place(channel)) {
      ++trace_.left_out;
      return;
    }
    if (channel_type(channel).layout == nullptr) {
      ++trace_.foreign[channel];
      return;
    }
    const auto suffix = [&channel](const char* prefix) {
      return channel.substr(std::string(prefix).size());
    };
    if (channel.starts_with("EST_")) {
      take<estimate_t>(event, [&](const estimate_t& m, ChannelTrouble& t) {
        on_estimate(m, trace_.estimators[suffix("EST_")], t);
      });
    } else if (channel.starts_with("SMOOTHED_")) {
      take<estimate_t>(event, [&](const estimate_t& m, ChannelTrouble& t) {
        on_estimate(m, trace_.estimators[suffix("SMOOTHED_") + kSmoothedSuffix], t);
      });
    } else if (channel.starts_with("TIMING_")) {
      take<timing_t>(event, [&](const timing_t& m, ChannelTrouble&) {
        EstimatorTrace& estimator = trace_.estimators[suffix("TIMING_")];
        estimator.compute_time.push_back({m.step, 1e-3 * static_cast<double>(m.compute_time_ns)});
        if (m.latency_ns >= 0)
          estimator.latency.push_back({m.step, 1e-3 * static_cast<double>(m.latency_ns)});
      });
    } else if (channel.starts_with("STATUS_")) {
      take<status_t>(event, [&](const status_t& m, ChannelTrouble&) { on_status(channel, m); });
    }
  }

  void on_truth(const truth_t& message, ChannelTrouble& trouble) {
    if (!is_step(message.step, trouble)) return;
    trace_.truth.try_emplace(message.step, TrueState{message.mode, message.state});
  }

  void on_frames(const can_frames_t& message, bool is_received) {
    if (!is_received) trace_.knows_attacks = true;
    for (const can_frame_t& frame : message.frames) {
      if (!is_received) {
        trace_.labeler.add_sent(frame);
        // A frame that is passed on keeps the stamp of the bus on which it was read.
        if (frame.receive_utime > 0) trace_.sensor_utimes[frame.index] = frame.receive_utime;
        continue;
      }
      trace_.labeler.add_received(frame);
      trace_.received.push_back({message.step, frame.index, frame.identifier, 0});
    }
  }

  void on_status(const std::string& channel, const status_t& message) {
    trace_.statuses[channel] = message;
    std::int64_t count = 0;
    for (std::size_t i = 0; i < message.counter_name.size(); ++i) {
      if (is_loss_counter(message.counter_name[i]))
        count += std::clamp<std::int64_t>(message.counter_value[i], 0, kCountMax);
    }
    trace_.losses[channel].push_back({message.step, count});
  }

  void on_signal(const attack_signal_t& message, ChannelTrouble& trouble) {
    trace_.knows_attacks = true;
    // What a rule adds reaches frames, and the records of those say what it did to them.
    if (!is_step(message.step, trouble) || message.name.starts_with(kRuleSignalPrefix)) return;
    std::vector<double>& signal = trace_.attack_signals[message.step];
    signal.insert(signal.end(), message.value.begin(), message.value.end());
    const auto acts = [](double value) { return value != 0.0; };
    if (attack_truth_ != AttackTruth::kFrames && std::ranges::any_of(message.value, acts))
      trace_.attacked_steps.insert(message.step);
  }

  void on_measurement(const measurement_set_t& message, ChannelTrouble& trouble) {
    if (!is_step(message.step, trouble)) return;
    trace_.measurement_steps.insert(message.step);
    for (const packet_t& packet : message.packets) {
      trace_.packets.push_back({message.step, packet.rx_index, packet.source, {}});
    }
    if (message.packets.empty() || message.packets.back().receive_utime <= 0) return;
    const packet_t& newest = message.packets.back();
    trace_.newest_packets.try_emplace(message.step,
                                      NewestPacket{newest.rx_index, newest.receive_utime});
  }

  // What a rule adds to a sensor's signal is an input that estimators may find.
  void note_input(const attack_frame_t& message) {
    CanFrame original, forwarded;
    if (!bus_inputs_ || !bus_inputs_->exists() || message.disposition != attack_frame_t::ALTERED ||
        !from_message(message.original, original) || !from_message(message.forwarded, forwarded)) {
      return;
    }
    std::vector<double>& added = added_inputs_[message.step];
    added.resize(static_cast<std::size_t>(bus_inputs_->num_channels()));
    bus_inputs_->add(message.step, original, forwarded, added);
  }

  void on_attack(const attack_frame_t& message, ChannelTrouble& trouble) {
    ++trace_.frames_touched;
    trace_.knows_attacks = true;
    const bool is_command = message.direction == attack_frame_t::TO_PLANT;
    if (!is_command && is_step(message.step, trouble)) {
      if (attack_truth_ != AttackTruth::kSignals) trace_.attacked_steps.insert(message.step);
      trace_.frame_actions[message.step] |= static_cast<std::uint32_t>(message.actions);
      const bool has_original = message.disposition != attack_frame_t::INJECTED;
      const can_frame_t& frame = has_original ? message.original : message.forwarded;
      trace_.touched.push_back(
          {message.step, message.rx_index, frame.identifier, message.disposition});
      note_input(message);
    }
    std::pair<std::string, std::string> key{message.rule, message.action};
    if (trace_.rules.size() >= kOtherChannelsMax && !trace_.rules.contains(key))
      key = {"(other rules)", ""};
    RuleReview& rule = trace_.rules[key];
    rule.rule = key.first;
    rule.action = key.second;
    if (const auto i = static_cast<std::size_t>(message.disposition); i < rule.frames.size())
      ++rule.frames[i];
    if (!is_command) trace_.labeler.add_attack(message);
  }

  void on_estimate(const estimate_t& message, EstimatorTrace& estimator, ChannelTrouble& trouble) {
    if (!is_step(message.step, trouble)) return;
    const auto [sample, is_new] = estimator.samples.try_emplace(message.step);
    if (!is_new) {
      ++estimator.repeated;
      return;
    }
    sample->second = {
        message.outcome,     message.attack_probability, message.input_step,
        message.mean,        message.covariance,         message.mode_probability,
        message.input_mean,  message.innovation,         message.innovation_covariance,
        mixtures_of(message)};
    for (std::size_t i = 0; i < message.packet_rx_index.size(); ++i) {
      const double posterior = message.packet_probability[i];
      if (posterior >= 0.0 && posterior <= 1.0) {
        estimator.packet_posteriors.emplace_back(message.packet_rx_index[i], posterior);
      }
    }
  }

  static std::vector<MixtureSize> mixtures_of(const estimate_t& message) {
    constexpr std::size_t kMixturesMax = 4;
    std::vector<MixtureSize> mixtures;
    for (const hypothesis_t& hypothesis : message.hypotheses) {
      if (hypothesis.num_components <= 0 || mixtures.size() == kMixturesMax) continue;
      mixtures.push_back({hypothesis.name, hypothesis.num_components, hypothesis.num_candidates});
    }
    return mixtures;
  }

  LogTrace& trace_;
  AttackTruth attack_truth_;
  std::set<std::string> known_channels_, other_channels_;
  std::map<std::string, std::int64_t> last_seq_, last_utime_;
  std::optional<FrameCodec> codec_;
  std::optional<BusInputs> bus_inputs_;
  std::map<std::int64_t, std::vector<double>> added_inputs_;  // by step, one for each channel
  std::int64_t last_log_utime_ = 0;
  bool has_log_time_ = false;
};

}  // namespace

std::string estimate_channel(const std::string& key) {
  if (!key.ends_with(kSmoothedSuffix)) return "EST_" + key;
  return "SMOOTHED_" + key.substr(0, key.size() - std::string(kSmoothedSuffix).size());
}

LogTrace collect_trace(LogReader& reader, const ScenarioFacts& facts, std::int64_t& num_events) {
  LogTrace trace;
  trace.num_steps = facts.num_steps;
  LogCollector collector(trace, facts);
  LogEvent event;
  for (num_events = 0; reader.next(event); ++num_events) collector.on_event(event);
  collector.finish();
  if (trace.num_steps == 0 && !trace.truth.empty()) trace.num_steps = trace.truth.rbegin()->first;
  std::size_t num_messages = std::max(trace.truth.size(), trace.measurement_steps.size());
  for (const auto& [suffix, estimator] : trace.estimators)
    num_messages = std::max(num_messages, estimator.samples.size());
  trace.num_scored = std::min(
      trace.num_steps, kStepsPerMessage * static_cast<std::int64_t>(num_messages) + kSpareSteps);
  return trace;
}

bool is_loss_counter(const std::string& name) {
  return name == "lcm_lost" || name.ends_with("kernel_dropped") || name.ends_with("write_dropped");
}

}  // namespace holdfast
