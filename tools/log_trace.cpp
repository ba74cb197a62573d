#include "tools/log_trace.h"

#include <algorithm>
#include <holdfast/attack_frame_t.hpp>
#include <holdfast/can_frames_t.hpp>
#include <holdfast/estimate_t.hpp>
#include <holdfast/measurement_set_t.hpp>
#include <holdfast/run_meta_t.hpp>
#include <holdfast/timing_t.hpp>
#include <holdfast/truth_t.hpp>
#include <limits>

namespace holdfast {
namespace {

// A larger jump of seq is a forged number, not a loss that a logger could have had.
constexpr std::int64_t kLossJumpMax = 1'000'000;

class LogCollector {
 public:
  explicit LogCollector(LogTrace& trace) : trace_(trace) {}

  void on_event(const LogEvent& event) {
    const std::string& channel = event.channel;
    const auto suffix = [&channel](const char* prefix) {
      return channel.substr(std::string(prefix).size());
    };
    if (channel == "PLANT_TRUTH") {
      take<truth_t>(event, [this](const truth_t& m, ChannelTrouble& t) { on_truth(m, t); });
    } else if (channel == "MEASUREMENT") {
      take<measurement_set_t>(event,
                              [this](const auto& m, ChannelTrouble& t) { on_measurement(m, t); });
    } else if (channel == "CAN_RX" || channel == "CAN_TX") {
      take<can_frames_t>(event, [&](const can_frames_t& m, ChannelTrouble&) {
        for (const can_frame_t& frame : m.frames) {
          channel == "CAN_RX" ? trace_.labeler.add_received(frame) : trace_.labeler.add_sent(frame);
        }
      });
    } else if (channel == "ATTACK_FRAME") {
      take<attack_frame_t>(event,
                           [this](const attack_frame_t& m, ChannelTrouble&) { on_attack(m); });
    } else if (channel == "RUN_META") {
      run_meta_t meta;
      if (decode_guarded(event.data, meta)) trace_.scenario_hashes.insert(meta.scenario_hash);
    } else if (channel.starts_with("EST_")) {
      take<estimate_t>(event, [&](const estimate_t& m, ChannelTrouble& t) {
        on_estimate(m, trace_.estimators[suffix("EST_")], t);
      });
    } else if (channel.starts_with("TIMING_")) {
      take<timing_t>(event, [&](const timing_t& m, ChannelTrouble&) {
        EstimatorTrace& estimator = trace_.estimators[suffix("TIMING_")];
        estimator.compute_time_us.push_back(1e-3 * static_cast<double>(m.compute_time_ns));
        if (m.latency_ns >= 0)
          estimator.latency_us.push_back(1e-3 * static_cast<double>(m.latency_ns));
      });
    } else if (channel.starts_with("STATUS_")) {
      take<status_t>(event,
                     [&](const status_t& m, ChannelTrouble&) { trace_.statuses[channel] = m; });
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
    note_seq(event.channel, message.seq, trouble);
    handler(message, trouble);
  }

  void note_seq(const std::string& channel, std::int64_t seq, ChannelTrouble& trouble) {
    const auto [last, is_first] = last_seq_.try_emplace(channel, seq);
    if (is_first) return;
    // An outsider that does not count leaves seq at 0.
    if (seq == 0 && last->second == 0) return;
    if (seq <= last->second || seq - last->second > kLossJumpMax) {
      ++trouble.backward_seq;
    } else {
      trouble.missing_seq += seq - last->second - 1;
    }
    last->second = std::clamp<std::int64_t>(seq, 0, std::numeric_limits<std::int64_t>::max() / 2);
  }

  bool is_step(std::int64_t step, ChannelTrouble& trouble) const {
    if (step == 0) return false;  // a prior, which has no measurement
    const bool fits = step > 0 && (trace_.num_steps == 0 || step <= trace_.num_steps);
    if (!fits) ++trouble.odd_step;
    return fits;
  }

  void on_truth(const truth_t& message, ChannelTrouble& trouble) {
    if (is_step(message.step, trouble)) trace_.truth.try_emplace(message.step, message.state);
  }

  void on_measurement(const measurement_set_t& message, ChannelTrouble& trouble) {
    if (!is_step(message.step, trouble)) return;
    trace_.measurement_steps.insert(message.step);
    for (const packet_t& packet : message.packets) {
      trace_.packets.push_back({message.step, packet.rx_index, packet.source, {}});
    }
  }

  void on_attack(const attack_frame_t& message) {
    ++trace_.frames_touched;
    RuleReview& rule = trace_.rules[{message.rule, message.action}];
    rule.rule = message.rule;
    rule.action = message.action;
    if (message.disposition == attack_frame_t::ALTERED) ++rule.altered;
    if (message.disposition == attack_frame_t::DROPPED) ++rule.dropped;
    if (message.disposition == attack_frame_t::INJECTED) ++rule.injected;
    trace_.labeler.add_attack(message);
  }

  void on_estimate(const estimate_t& message, EstimatorTrace& estimator, ChannelTrouble& trouble) {
    if (!is_step(message.step, trouble)) return;
    const auto [sample, is_new] = estimator.samples.try_emplace(message.step);
    if (!is_new) {
      ++estimator.repeated;
      return;
    }
    sample->second = {message.outcome, message.mean, message.covariance};
    for (std::size_t i = 0; i < message.packet_rx_index.size(); ++i) {
      const double posterior = message.packet_probability[i];
      if (posterior >= 0.0 && posterior <= 1.0) {
        estimator.packet_posteriors.emplace_back(message.packet_rx_index[i], posterior);
      }
    }
  }

  LogTrace& trace_;
  std::map<std::string, std::int64_t> last_seq_;
};

}  // namespace

LogTrace collect_trace(LogReader& reader, std::int64_t num_steps, std::int64_t& num_events) {
  LogTrace trace;
  trace.num_steps = num_steps;
  LogCollector collector(trace);
  LogEvent event;
  for (num_events = 0; reader.next(event); ++num_events) collector.on_event(event);
  if (num_steps == 0 && !trace.truth.empty()) trace.num_steps = trace.truth.rbegin()->first;
  return trace;
}

}  // namespace holdfast
