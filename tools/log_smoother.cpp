#include "tools/log_smoother.h"

#include <holdfast/estimate_t.hpp>
#include <holdfast/measurement_set_t.hpp>
#include <iostream>
#include <set>
#include <vector>

#include "common/log_file.h"
#include "common/status.h"
#include "estimators/attack_mixture.h"
#include "estimators/estimate_messages.h"
#include "estimators/estimator_session.h"
#include "estimators/smoothed_stream.h"
#include "tools/experiment.h"
#include "tools/log_meta.h"
#include "tools/log_replay.h"

namespace holdfast {
namespace {

// One estimator on its way through the log, and what it said of each step in the end.
struct Smoothed {
  std::string channel;
  std::unique_ptr<Estimator> estimator;
  EstimatorSession session;
  SmoothedStream stream;
  std::vector<Estimate> estimates;  // ascending steps
  std::size_t num_written = 0;

  void keep() {
    stream.on_step([this](const Estimate& estimate) { estimates.push_back(estimate); });
  }
};

std::vector<Smoothed> make_smoothed(const LogSmootherOptions& options, const Experiment& experiment,
                                    std::uint32_t run) {
  std::vector<Smoothed> all;
  if (!options.name.empty()) experiment.estimator(options.name);
  for (const EstimatorEntry& entry : experiment.estimators) {
    const bool is_wanted = options.name.empty() ? entry.is_smoothed : entry.name == options.name;
    if (!is_wanted) continue;
    if (entry.is_outside() || entry.is_campaign_only()) {
      if (options.name.empty()) continue;
      throw UsageError(
          "estimator '" + entry.name + "' " +
          (entry.is_outside() ? "is an outside command" : "sees what only a simulation knows") +
          ": it cannot be run on a log");
    }
    std::unique_ptr<Estimator> estimator = experiment.make_estimator(entry, run);
    if (options.statistics) {
      const auto* mixture = dynamic_cast<const AttackMixture*>(estimator.get());
      if (mixture != nullptr) estimator = mixture->renewed(*options.statistics);
    }
    auto* smoothing = dynamic_cast<SmoothingEstimator*>(estimator.get());
    if (smoothing == nullptr) {
      throw UsageError("estimator '" + entry.name + "' (" + entry.method + ") cannot look back");
    }
    EstimatorSession session(*estimator, experiment.num_steps, experiment.step_s(),
                             experiment.known_inputs());
    SmoothedStream stream(*smoothing,
                          static_cast<std::size_t>(options.lag_steps.value_or(entry.lag_steps)));
    all.push_back(
        {channel_name("SMOOTHED_", entry.name), std::move(estimator), session, stream, {}, 0});
  }
  return all;
}

// First pass: every measurement set through every estimator.
void smooth_sets(const LogSmootherOptions& options, std::int64_t num_steps,
                 std::vector<Smoothed>& all) {
  for_each_set(options.program, options.log_file,
               [&](const MeasurementSet& set, const LogEvent& /*event*/) {
                 for (Smoothed& one : all)
                   one.session.on_set(set, [&one](const Estimate&) { one.keep(); });
                 if (options.on_progress) options.on_progress(set.step, num_steps);
               });
  for (Smoothed& one : all) {
    one.stream.finish([&one](const Estimate& estimate) { one.estimates.push_back(estimate); });
  }
}

// Second pass: the old log, with the estimates of each step where its set stands.
std::int64_t write_all(const LogSmootherOptions& options, std::vector<Smoothed>& all) {
  std::set<std::string> replaced;
  for (const Smoothed& one : all) replaced.insert(one.channel);
  LogWriter writer(options.out_file, LogWriter::Appears::kWhenFinished);
  estimate_t out;
  std::int64_t num_written = 0;
  // Stamped as the event before it: a live log's stamps are wall-clock time, those in the estimates
  // are the plant's.
  const auto write_until = [&](std::int64_t step, std::int64_t utime) {
    for (Smoothed& one : all) {
      for (; one.num_written < one.estimates.size(); ++one.num_written, ++num_written) {
        const Estimate& estimate = one.estimates[one.num_written];
        if (estimate.step > step) break;
        to_message(estimate, out);
        writer.write_message(one.channel, utime, out);
      }
    }
  };
  LogReader reader(options.log_file);
  LogEvent event;
  measurement_set_t message;
  std::int64_t last_utime = 0;
  while (reader.next(event)) {
    if (replaced.contains(event.channel)) continue;
    writer.write(event.channel, event.utime, event.data);
    if (event.channel == "MEASUREMENT" && decode_guarded(event.data, message)) {
      write_until(message.step, event.utime);
    }
    last_utime = event.utime;
  }
  write_until(INT64_MAX, last_utime);
  writer.finish();
  return num_written;
}

}  // namespace

std::int64_t smooth_log(const LogSmootherOptions& options) {
  check_new_log(options.log_file, options.out_file);
  const auto [meta, experiment] = read_logged_experiment(options.log_file);
  warn_of_kernel("holdfast-smoother", experiment, meta);
  std::vector<Smoothed> all =
      make_smoothed(options, experiment, static_cast<std::uint32_t>(meta.run));
  if (all.empty()) {
    throw UsageError(options.log_file +
                     ": no estimator of its scenario has the key `smoother`; name one with --name");
  }
  smooth_sets(options, experiment.num_steps, all);
  return write_all(options, all);
}

}  // namespace holdfast
