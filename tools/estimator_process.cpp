#include "tools/estimator_process.h"

#include "common/clock.h"
#include "common/measurement_messages.h"
#include "estimators/estimate_messages.h"

namespace holdfast {
namespace {

std::unique_ptr<Estimator> make_live_estimator(const Experiment& experiment,
                                               const EstimatorEntry& entry) {
  if (entry.is_outside()) throw UsageError("estimator '" + entry.name + "' is an outside command");
  if (entry.is_campaign_only()) {
    throw UsageError("estimator '" + entry.name +
                     "' sees what only a simulation knows: it runs in a campaign only");
  }
  return experiment.make_estimator(entry, 0);
}

}  // namespace

EstimatorProcess::EstimatorProcess(const Experiment& experiment, const EstimatorEntry& entry,
                                   LcmLink& link)
    : link_(link),
      status_(link, entry.name),
      estimator_(make_live_estimator(experiment, entry)),
      session_(*estimator_, experiment.num_steps, experiment.step_s(), experiment.known_inputs()),
      estimate_channel_(channel_name("EST_", entry.name)),
      timing_channel_(channel_name("TIMING_", entry.name)),
      smoothed_channel_(channel_name("SMOOTHED_", entry.name)),
      smoothed_(fixed_lag_stream(entry, *estimator_)) {
  link.subscribe<measurement_set_t>(
      "MEASUREMENT", [this](const measurement_set_t& received) { on_set(received); });
}

void EstimatorProcess::on_set(const measurement_set_t& received) {
  from_message(received, set_);
  started_ns_ = monotonic_time_ns();
  session_.on_set(set_, [this](const Estimate& estimate) { publish(estimate); });
  status_.set_state(ProcessState::kRunning);
  if (session_.is_finished() && on_finished_) on_finished_();
}

void EstimatorProcess::publish(const Estimate& estimate) {
  timing_.compute_time_ns = monotonic_time_ns() - started_ns_;
  to_message(estimate, message_);
  link_.publish(estimate_channel_, message_);
  timing_.utime = estimate.utime;
  timing_.step = estimate.step;
  // The newest packet's kernel stamp is when the set's last reading stood on the bus.
  const bool is_stamped = !set_.packets.empty() && set_.packets.back().receive_utime > 0;
  timing_.latency_ns = is_stamped ? (wall_utime() - set_.packets.back().receive_utime) * 1000 : -1;
  link_.publish(timing_channel_, timing_);
  const bool is_ok =
      estimate.outcome == StepOutcome::kOk || estimate.outcome == StepOutcome::kNoPackets;
  if (!is_ok) ++status_.counter("steps_not_ok");
  if (smoothed_) publish_smoothed();
  started_ns_ = monotonic_time_ns();
}

void EstimatorProcess::publish_smoothed() {
  const auto publish_one = [this](const Estimate& estimate) {
    to_message(estimate, message_);
    link_.publish(smoothed_channel_, message_);
  };
  smoothed_->on_step(publish_one);
  if (session_.is_finished()) smoothed_->finish(publish_one);
}

void EstimatorProcess::publish_status() {
  status_.set_step(session_.step());
  status_.counter("missing_steps") = session_.counters().missing_steps;
  status_.counter("old_sets") = session_.counters().old_sets;
  status_.counter("beyond_end") = session_.counters().beyond_end;
  status_.publish();
}

}  // namespace holdfast
