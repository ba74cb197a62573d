#include <iostream>

#include "common/log_file.h"
#include "drivers/event_loop.h"
#include "tools/estimator_process.h"
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
  LcmLink link(options.lcm_url);
  EventLoop loop;
  EstimatorProcess process(experiment, entry, link);
  bool is_stopped = false;
  process.on_finished([&] { loop.stop(); });
  loop.watch(link.file_descriptor(), [&] { link.handle_pending(); });
  loop.every(0.25, [&] { process.publish_status(); });
  loop.on_stop_signal([&] {
    is_stopped = true;
    loop.stop();
  });
  process.set_state(ProcessState::kReady);
  process.publish_status();
  loop.run();
  process.set_state(is_stopped ? ProcessState::kFailed : ProcessState::kFinished);
  process.publish_status();
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
  auto* log = app.add_option("--log", options.log,
                             "Log, or run's folder, to read instead of LCM; its scenario is used");
  app.add_option("--out", options.out, "Log to write")->needs(log);
  return holdfast::run_command_line(app, "holdfast-estimator", argc, argv, [&] {
    if (options.log.empty()) return holdfast::run_live(options);
    if (options.out.empty()) throw holdfast::UsageError("--log needs --out FILE for the estimates");
    holdfast::replay_log(holdfast::log_of_run(options.log), options.out, options.name);
    std::cout << options.out << ": written\n";
    return 0;
  });
}
