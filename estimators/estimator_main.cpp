#include <holdfast/estimate_t.hpp>
#include <holdfast/measurement_set_t.hpp>
#include <holdfast/run_meta_t.hpp>
#include <holdfast/timing_t.hpp>
#include <iostream>

#include "common/clock.h"
#include "common/measurement_messages.h"
#include "common/run_meta.h"
#include "common/status.h"
#include "drivers/event_loop.h"
#include "estimators/estimate_messages.h"
#include "estimators/estimator_session.h"
#include "tools/log_replay.h"
#include "tools/program_options.h"

namespace holdfast {
namespace {

struct EstimatorOptions : ProgramOptions {
  std::string name, log, out;
};

// Live: MEASUREMENT in, EST_<NAME> and TIMING_<NAME> out, until the scenario's last step.
int run_live(const EstimatorOptions& options) {
  if (options.scenario.empty())
    throw UsageError("give --scenario FILE, or --log LOG to replay one");
  const Experiment experiment = options.load();
  const EstimatorEntry& entry = experiment.estimator(options.name);
  if (entry.is_outside()) throw UsageError("estimator '" + entry.name + "' is an outside command");
  if (entry.input == EstimatorEntry::Input::kClean) {
    throw UsageError("estimator '" + entry.name +
                     "' sees clean readings: it runs in a campaign only");
  }
  const std::unique_ptr<Estimator> estimator = experiment.make_estimator(entry, 0);
  EstimatorSession session(*estimator, experiment.num_steps, experiment.model.step_s);
  LcmLink link(options.lcm_url);
  StatusReporter status(link, entry.name);
  const std::string estimate_channel = channel_name("EST_", entry.name);
  const std::string timing_channel = channel_name("TIMING_", entry.name);

  EventLoop loop;
  bool is_stopped = false;
  MeasurementSet set;
  estimate_t message;
  timing_t timing;
  std::int64_t started_ns = 0;
  const auto on_estimate = [&](const Estimate& estimate) {
    timing.compute_time_ns = monotonic_time_ns() - started_ns;
    to_message(estimate, message);
    link.publish(estimate_channel, message);
    timing.utime = estimate.utime;
    timing.step = estimate.step;
    // The newest packet's kernel stamp is when the set's last reading stood on the bus.
    const bool is_stamped = !set.packets.empty() && set.packets.back().receive_utime > 0;
    timing.latency_ns = is_stamped ? (wall_utime() - set.packets.back().receive_utime) * 1000 : -1;
    link.publish(timing_channel, timing);
    if (estimate.outcome != StepOutcome::kOk) ++status.counter("steps_not_ok");
    started_ns = monotonic_time_ns();
  };
  const auto publish_status = [&] {
    status.set_step(session.step());
    status.counter("missing_steps") = session.counters().missing_steps;
    status.counter("old_sets") = session.counters().old_sets;
    status.counter("beyond_end") = session.counters().beyond_end;
    status.publish();
  };
  link.subscribe<measurement_set_t>("MEASUREMENT", [&](const measurement_set_t& received) {
    from_message(received, set);
    started_ns = monotonic_time_ns();
    session.on_set(set, on_estimate);
    if (session.is_finished()) loop.stop();
  });
  loop.watch(link.file_descriptor(), [&] { link.handle_pending(); });
  loop.every(0.25, publish_status);
  loop.on_stop_signal([&] {
    is_stopped = true;
    loop.stop();
  });
  status.set_state(ProcessState::kReady);
  publish_status();
  loop.run();
  status.set_state(is_stopped ? ProcessState::kFailed : ProcessState::kFinished);
  publish_status();
  return is_stopped ? 1 : 0;
}

}  // namespace
}  // namespace holdfast

int main(int argc, char** argv) {
  CLI::App app{"Runs one estimator of a scenario on MEASUREMENT, or estimators again on a log."};
  app.footer(
      "Examples:\n"
      "  holdfast-estimator --scenario scenarios/binary_tracking.yaml --name secure\n"
      "  holdfast-estimator --log run/log.lcm --out again.lcm              (every estimator of the "
      "log)\n"
      "  holdfast-estimator --log run/log.lcm --out again.lcm --name secure");
  holdfast::EstimatorOptions options;
  app.add_option("--scenario", options.scenario, "Scenario file (YAML)");
  app.add_option("--set", options.overrides, "Override a key: path.to.key=value (repeatable)")
      ->allow_extra_args(false);
  options.add_lcm(app);
  app.add_option("--name", options.name, "Name of the estimator in the scenario");
  auto* log =
      app.add_option("--log", options.log, "Log to read instead of LCM; its scenario is used");
  app.add_option("--out", options.out, "Log to write")->needs(log);
  const int status = holdfast::parse_command_line(app, "holdfast-estimator", argc, argv);
  if (status >= 0) return status;
  return holdfast::run_program("holdfast-estimator", [&] {
    if (options.log.empty()) return holdfast::run_live(options);
    if (options.out.empty()) throw holdfast::UsageError("--log needs --out FILE for the estimates");
    holdfast::replay_log(options.log, options.out, options.name);
    return 0;
  });
}
